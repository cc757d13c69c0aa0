"""What files hold that are of no study: shape libraries and trajectories."""
