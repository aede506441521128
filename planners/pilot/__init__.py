"""Driving the real robot: the line to its valve controller, poses from its cameras, the closed loop."""
