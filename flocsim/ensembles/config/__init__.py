"""A study's TOML file: what may stand in it, how it is read strictly, and the objects it makes.

``schema`` holds every table and key, ``pair_scene`` and ``kernel_scene`` those of [scene], a class
for each kind of it, which other kinds keep in their folders (``kinds`` is the table of all);
``loader`` makes a Config of a file. Under it lie ``presets``, over it ``--set``;
``sources`` keeps what was read of files. ``values`` reads one value, and tells all that is wrong at
once, with the lines that ``toml_text`` knows; ``own_classes`` finds a user's force, integrator or
shape. May import forces, integrators, geometry and body, and nothing else of
``ensembles``.

The readers are our own, not cattrs: that would replace one loop of twelve lines, while units,
dimensions and every message stayed ours and its exceptions had to be turned back into places.
"""
