"""The results file of an ensemble: its schema, its layout in HDF5, reading and writing."""
