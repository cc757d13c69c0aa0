"""What holds two bodies together: one proof for pairs, for swarms, and where kicks act.

`bond`: two bodies and the load on them as kernels see them; `certificate`: no later load can open
it, judged by attraction on the way out; `statics`: the contacts carry the load, so that shapes hook
into each other; `rest`: the pose has been kept, and which kind of bond that makes.

All of them are scalar kernels on (scene, work, …): the observer of a pair and the gauge of a swarm
call the same ones, and differ in what they know of the load alone.
"""
