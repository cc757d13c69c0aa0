"""From plain Python functions to machine code that is warm from disk and never stale.

``composer``: engines and laws compiled and kept.
``fingerprint``: what a function does, as a hash, and what a kernel may not do.
``disk_cache``: what is kept on disk, what of it is to be trusted, and loaded without numba.
``processor``: what of the machine decides the last digits.
``linker``: what a function reads beside its arguments; clones of it that read others.
``units``: what is compiled by itself; what is said meanwhile.
``by_pointer``: how arguments are handed over.
``numba_internals``: all else that leans on numba's private parts.  Imports errors only.
"""
