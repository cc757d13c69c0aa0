"""Pictures to flocs, by scikit-image: `segment` in ``pictures`` finds them, step by step.

``reading``: files → grey; ``background``: noise, light and threshold → foreground; ``regions``:
foreground → flocs, those that touch parted; ``masks``: flocs that are given without a picture;
``recognition``: which of the two a file is.
"""
