"""Shape libraries (``library``), and what a fit tells its user (``fit_report``)."""
