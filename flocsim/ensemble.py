"""`mpirun -n 2 python -m flocsim.ensemble cfg.toml`: run an ensemble of collisions."""

import sys

from flocsim.ensembles.cli import main

if __name__ == "__main__":
    sys.exit(main())
