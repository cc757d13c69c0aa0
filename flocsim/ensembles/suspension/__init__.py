"""Studies of swarms: from `[scene] kind = "swarm"` to a results file.

`study` makes the bodies of a replicate, `replicate` runs one from wherever it was left, `records`
is what of it goes into the journal, `dealing` hands replicates to ranks, `runner` is the command,
`identity` what a resumed run has to agree on.
"""
