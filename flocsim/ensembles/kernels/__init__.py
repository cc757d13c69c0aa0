"""Studies of rates: from `[scene] kind = "kernel"` to replicates that sample orientations and
offsets evenly. `sampling` has the points, `study` the replicate of each; what follows from the rows
is in `ensembles.estimates.capture`.
"""
