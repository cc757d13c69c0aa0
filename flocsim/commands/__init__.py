"""The subcommands of ``flocsim``, one file each; ``fit_pictures`` is the work behind ``fit`` and
``fit_processes`` the processes that do it.

A subcommand is a file with ``add_parser(subparsers)`` and ``run(arguments)``, the exit code, listed
in `flocsim.__main__`.
"""
