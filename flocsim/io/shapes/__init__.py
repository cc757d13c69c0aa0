"""Shape libraries, and what a fit tells its user."""
