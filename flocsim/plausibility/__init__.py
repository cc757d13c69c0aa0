"""What is known of a scene before it moves: how its bodies settle, and how plausible it is."""
