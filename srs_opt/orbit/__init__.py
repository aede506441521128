"""Steady gaits: the relative periodic orbit of a gait, its motion, envelope and stability."""
