"""One replicate of a binary collision: its flocs, start, zone, and the observer that decides it.

May import ``config``.
"""
