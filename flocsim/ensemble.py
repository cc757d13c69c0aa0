"""`mpirun -n 2 python -m flocsim.ensemble cfg.toml`: run an ensemble of collisions."""

import sys

from flocsim.interruption import install
from flocsim.io.terminal import fill_descriptors
from flocsim.limits import check_memory

if __name__ == "__main__":
    fill_descriptors()
    install()  # before anything slow is imported
    check_memory()

    from flocsim.ensembles.cli import main

    sys.exit(main())
