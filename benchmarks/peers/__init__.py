"""Other codes and solvers on the same pair of bodies: SciPy's stiff solvers on flocsim's compiled
forces, LAMMPS with its own.
"""
