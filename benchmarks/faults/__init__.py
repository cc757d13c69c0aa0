"""What goes wrong and costs nothing: launchers, a batch system, other processors."""
