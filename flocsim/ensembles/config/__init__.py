"""A study's TOML file: what may stand in it, how it is read strictly, and the objects it makes.

Imports nothing else of ``ensembles``.
"""
