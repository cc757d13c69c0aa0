"""Whole studies as a script has them: a Study, and one swept over a key.

A Study runs by the command, `flocsim ensemble`, in processes of its own: its files are the
command's, bytes and rules.
"""
