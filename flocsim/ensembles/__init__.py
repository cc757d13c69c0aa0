"""Ensembles of binary collisions: config, scene, sampling, outcomes, statistics, runners."""
