"""The parts of a Radau IIA step: tableau, stages, linear systems, frames that follow the contacts.

May import ``rhs``; Implicit and Overdamped are made of it.
"""
