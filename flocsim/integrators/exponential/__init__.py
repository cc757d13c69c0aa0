"""Exponential collocation: steps that solve linear forces exactly, as power series in time, and
collocate the rest. The forces in an impact are nearly linear. May import ``radau`` and ``rhs``."""
