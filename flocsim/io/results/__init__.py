"""The results file of an ensemble: its columns (schema), how it is laid out, written and read.

A column is declared in ``schema``, and in no other file of this room; ``page`` makes
docs/results.md from it. What a replicate's columns hold is computed in
`flocsim.ensembles.collision.encounter`, the probabilities in `flocsim.ensembles.estimates`.
"""
