"""The kind of studies of swarms: `[scene] kind = "swarm"`.

`study` makes the bodies of a replicate, `replicate` runs one from wherever it was left, `records`
is what of it goes into the journal, `checks` what of that can be believed, `assembly` makes results
of it, `kind` is what rank 0 asks; `scene` the table [scene], `contents` and `comparison`
what commands show of a file and of two.
"""
