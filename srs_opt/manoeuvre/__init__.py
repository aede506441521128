"""Manoeuvres: optimal switch times over several periods, from a state to a state."""
