"""What things cost: replicates, force evaluations, fits, pictures, starts, ranks; and how much more
other methods cost for the same error. `scenes` and `collisions.toml` are the scenes that all
benchmarks share, `measure` and `cases` run and time them.
"""
