"""The kind of studies of swarms: `[scene] kind = "swarm"`.

`scene` is the table [scene]; `study` makes the bodies of a replicate and runs it from its start or
from wherever it was stopped; `results` is what is saved of it, what becomes of that, and what
commands show of a file and of two.
"""
