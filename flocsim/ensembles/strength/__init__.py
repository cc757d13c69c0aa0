"""How strong bonds are: at what rate a flow opens the doublets that a study has found bound.

`opening` runs one doublet at rising rates; `survey` all doublets of a results file, for
`flocsim strength`; `contents` is what commands show of its file.
"""
