"""Which rank does what: chunks of replicates handed out, run and taken in again.

May import ``storage`` and ``collision``.
"""
