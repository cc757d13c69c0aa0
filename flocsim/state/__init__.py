"""The state of a run, as records and arrays with named fields.

`records` has the base class of all records; `bodies`, `contacts`, `clock` and `outlines` declare
them. `views` are the arguments of force kernels. `scene` is what stays constant in a run, `work`
what changes.
"""
