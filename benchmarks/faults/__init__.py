"""What goes wrong and costs nothing: kills, signals, full disks, damaged files, odd config files,
other processors."""
