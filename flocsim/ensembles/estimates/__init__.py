"""From rows to probabilities with intervals: of single conditions, pooled, paired.

Also the rule that stops a study.

May import ``storage``.
"""
