"""What an HDF5 file must be before the HDF5 library is let at it.

``structure`` walks the bytes of a file and refuses all that flocsim does not write; ``types``
are the few types of values; ``expected`` holds what was found against a schema.
"""
