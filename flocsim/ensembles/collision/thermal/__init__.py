"""Pairs under thermal motion: how far kicks let them climb (climb), and what becomes of them
(kicked).
"""
