"""Measured speed, accuracy and growth; see README.md."""
