"""Pairs under thermal motion: where they are let go (release), how far kicks let them climb
(climb), and what becomes of them (kicked).
"""
