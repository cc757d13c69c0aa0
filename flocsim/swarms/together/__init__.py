"""What hangs together in a swarm: gaps, clusters, and what holds them."""
