"""What a few replicates, run before all others, tell of a study.

ladder: which replicates a pilot runs, one at a setting and what it costs; the settings that it
tries, and how many outcomes flip at a tolerance, from those that were seen to; choice:
`integrator.accuracy = "auto"`, the cheapest setting that is accurate enough. Both are functions of
config and seed, and look at no clock. forecast, for `--dry-run` alone: what a study will take,
which of its forces changed no outcome, and whether inertia did.

May import study and what lies below it, and `storage.identity`, which says what a choice is of.
"""
