"""The kind of studies of swarms: `[scene] kind = "swarm"`.

`study` makes the bodies of a replicate, `replicate` runs one from wherever it was left, `records`
is what of it goes into the journal, when that can be believed, and the results that it makes;
`kind` is what rank 0 asks, `scene` the table [scene], `contents` what commands show of a file and
of two.
"""
