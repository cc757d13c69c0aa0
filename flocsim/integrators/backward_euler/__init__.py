"""Backward Euler with the contacts of the step's end, for beds whose contacts switch all the time.

May import ``loop``, ``radau``, ``events`` and ``rhs``; a swarm chooses it for an island.
"""
