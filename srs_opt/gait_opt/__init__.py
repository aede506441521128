"""Optimal periodic valve timing: collocation, rounding, switch times, certificate, gait tables."""
