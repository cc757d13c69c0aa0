"""Questions about a study that can be answered before it is run, each answered once.

preflight: what is wrong or implausible; spheres: what the equivalent spheres would do; dry_run:
all of that as text; pilot: how long it will take, from a few replicates; accuracy: how far a run is
from a more exact one of the same replicate (`flocsim check`, `flocsim work-precision`).
"""
