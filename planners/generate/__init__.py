"""Seeded mazes for tests and users: ``python -m planners.generate``.

``passages`` carves mazes of cells (perfect, braided), ``rooms`` divides an area into rooms with doors,
``corridor`` makes one narrow passage of a wanted width.
"""
