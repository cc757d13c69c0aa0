"""Files and pictures: results, journals, images, shape libraries, figures.

``files`` writes whole files or none; each heavyweight library is imported in one room only.
"""
