"""Some replicates of a study, run before all others by `--dry-run --pilot` and `work-precision`.

trials: which replicates, and one of them run by any method; forecast: how long a study takes, and
which of its forces, or inertia, changed no outcome.

May import study and what lies below it.
"""
