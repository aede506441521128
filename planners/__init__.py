"""Maze planning for soft snakes: the whole undulating body, gaits chosen on the way."""
