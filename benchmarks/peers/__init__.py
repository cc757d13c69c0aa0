"""Other codes and solvers: SciPy's stiff solvers on flocsim's compiled forces and LAMMPS, on one
pair of bodies; the rigid-body engines pymunk and Box2D, on scenes that flocsim can do, too.
"""
