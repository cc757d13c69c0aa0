"""Many bodies: islands of those that act on each other, each with its own steps, advanced from one
common time to the next.

May import ``system`` and all below it; knows nothing of studies.
"""
