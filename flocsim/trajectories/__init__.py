"""Trajectories: what a run was, at any time of it, and how it goes on.

`trajectory` is what System.run returns; `replay` goes through its run again.
"""
