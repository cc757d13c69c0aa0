"""Bonds: criteria that two bodies stay together, shared by pairs, swarms and thermal motion.

`certificate`: a proof that no later load can open the bond, from attraction alone. `rest`: bonds
whose pose was stable under the largest load, and whether the contacts carry that load by their
shape (hooks).

All functions are scalar kernels on (scene, work, …). The observer of a pair and the gauge of a
swarm call the same ones with different loads.
"""
