"""Pictures to flocs, by scikit-image: `segment` in ``pictures`` finds them, step by step.

``reading``: files → grey; ``background``: noise and light; ``outlines``: contrast → where flocs
end, by ``focus``; ``boxes``: pieces of a picture; ``regions``: outlines → flocs, those that touch
parted; ``masks``: flocs that are given without a picture; ``pictures``, too: which of them count,
and for how many.
"""
