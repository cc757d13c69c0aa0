"""How fast, how exact and how robust flocsim is, measured; not installed with it.

Run from the folder of the repository: `python -m benchmarks.speed.throughput`, `--help` for its
options. `refresh` puts the tables into docs/evidence/. They may use flocsim, tests.reference and
tests.helpers.
"""

import os

# One core is measured. Before numpy or numba is imported: they read these once.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
