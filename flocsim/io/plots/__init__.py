"""All figures.  The one room that loads matplotlib."""
