"""`mpirun -n 2 python -m flocsim.ensemble cfg.toml`: the same as `flocsim ensemble cfg.toml`."""

import sys

if __name__ == "__main__":
    sys.argv.insert(1, "ensemble")

    from flocsim.__main__ import main

    sys.exit(main())
