"""Other codes and solvers on the same pair of bodies."""
