"""What goes wrong and costs nothing: two jobs for one output, launchers, a batch system,
other processors."""
