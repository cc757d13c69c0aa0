"""The subcommands of ``flocsim``, one file each; ``fitting`` is the work behind ``fit``,
``reporting`` that behind ``report``.

A subcommand is a file with ``add_parser(subparsers)`` and ``run(arguments)``, the exit code, listed
in `flocsim.__main__`.
"""
