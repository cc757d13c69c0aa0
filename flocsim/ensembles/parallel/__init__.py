"""Which rank does what: chunks of replicates handed out, run and taken in again.

Rank 0 keeps what is known of the study (`schedule`: what is done and what is to be done) and
answers the others; every rank, rank 0 too, runs chunks (`coordinator`). Messages go through a
`communicator`, which also tells when a rank is lost: one process, MPI, or `processes` of this
machine. Before anything runs the ranks compare what they would run (`flocsim.ensembles.runner`).
`runner` puts them together. May import ``storage`` and ``collision``.
"""
