"""Studies of pairs and of rates: `study`, how results are made of rows; `results`, what commands
show of a file; `opened`, what a script has of one; `comparison`, of two.

How a pair is drawn and run is in `flocsim.ensembles.study`. May import report, estimates, storage.
"""
