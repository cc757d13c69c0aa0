"""Shapes, distances between them, and the contact points of two bodies."""
