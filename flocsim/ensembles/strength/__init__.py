"""How strong bonds are: at what rate a flow opens the doublets that a study has found bound.

`opening` runs one doublet at rising rates; `kind` all doublets of a results file; `contents` is
what commands show of such a survey.
"""
