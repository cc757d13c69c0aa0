"""What is known of an unfinished study: its identity, its journal, and how a run goes on with it.

May import ``collision`` and ``config``.
"""
