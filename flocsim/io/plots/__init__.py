"""All figures; the one room that loads matplotlib, inside functions.

``results``: figures of a results file; ``curves``: along keys, sizes and rates; ``shapes``: of a
shape library and of fits; ``collision``: of one trajectory; ``style``: the look that they share,
and saving. A new figure of a results file is one function in ``results``, entered in FIGURES there.
"""
