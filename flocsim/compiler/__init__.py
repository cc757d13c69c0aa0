"""From plain Python functions to machine code that is warm from disk and never stale.

``composer``: engines and laws compiled and kept.
``units``: what is compiled by itself, and how units are put together.
``fingerprint``: what a function does, as a hash, and what a kernel may not do.
``linker``: what a function reads beside its arguments; clones of it that read others.
``by_pointer``, ``table_types``: how arguments are handed over, and what is made of them.
``object_code``: machine code as a file, made and loaded by LLVM alone.
``disk_cache``: what is kept on disk, and what of it is to be trusted.
``processor``: what of the machine decides the last digits.
``accelerator``: numba's private parts, which save time and may be absent.
"""
