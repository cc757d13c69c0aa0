"""The subcommands of ``flocsim``, one file each."""
