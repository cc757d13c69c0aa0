"""`mpirun -n 2 python -m flocsim.ensemble cfg.toml`: run an ensemble of collisions."""

import sys

from flocsim.process import check_memory, install

if __name__ == "__main__":
    install()  # before anything slow is imported
    check_memory()

    from flocsim.ensembles.cli import main

    sys.exit(main())
