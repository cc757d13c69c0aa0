"""Two bodies that meet by thermal motion: how likely they touch before they have escaped.

`splitting` has it for spheres as integrals over their interaction; `meeting` finds it for any
bodies by running them.
"""
