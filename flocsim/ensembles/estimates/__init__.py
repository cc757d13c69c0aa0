"""From rows to probabilities: counts, intervals, paired and pooled differences, the stop rule.

May import ``storage``.
"""
