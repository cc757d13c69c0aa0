"""How exact results are: error against run time by method, and outcomes by tolerance."""
