"""Studies of pairs and of rates: what rank 0 asks of them, what their files hold and show.

Imports ensembles' study, kernels, estimates, storage and report, and io.
"""
