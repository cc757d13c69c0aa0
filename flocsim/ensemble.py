"""`mpirun -n 2 python -m flocsim.ensemble cfg.toml`: run an ensemble of collisions."""

import sys

from flocsim.interruption import install

if __name__ == "__main__":
    install()  # before anything slow is imported

    from flocsim.ensembles.cli import main

    sys.exit(main())
