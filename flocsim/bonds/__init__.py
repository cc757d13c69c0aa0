"""What holds two bodies together: one proof for pairs, for swarms, and where kicks act.

`certificate`: two bodies and the load on them as kernels see them, and whether no later load can
open their bond, judged by attraction on the way out; `rest`: the pose has been kept, and whether
the contacts carry the load by themselves, so that shapes hook into each other.

All of them are scalar kernels on (scene, work, …): the observer of a pair and the gauge of a swarm
call the same ones, and differ in what they know of the load alone.
"""
