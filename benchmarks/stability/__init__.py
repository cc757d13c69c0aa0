"""The stability table: random cases over all of the model's range, each right or clearly failed.

`case` says what a case is and draws numbers; `shapes` makes bodies and puts them in place;
`spheres`, `settling_pair` and `polygons` are the families of cases with what their references
answer (`references`: by another method); `families` counts them out; `verdict` judges a run;
`workers` runs many in processes that can be killed; `run` is the command.
"""
