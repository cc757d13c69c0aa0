"""Pairs under thermal motion: where they are let go (release), where kicks keep them apart (cage),
and what becomes of them (kicked).
"""
