"""Searches for a sequence of gaits: a deterministic lattice search and OMPL's planners."""
