"""What a run of the engine knows, as records and arrays whose names say what they are.

`records` has the base of all records, `bodies`, `contacts`, `clock` and `outlines` declare them,
`views` is what the kernels of forces see, `scene` what stays as it is in a run, and `work` what
changes.
"""
