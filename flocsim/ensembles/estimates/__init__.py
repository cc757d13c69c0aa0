"""From rows to probabilities with intervals: of single conditions, pooled, paired.

Also the rule that stops a study, and which outcomes change between two runs of one.

May import ``storage``.
"""
