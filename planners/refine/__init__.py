"""Certified plans made faster: all valve switches, cycle ends and pressures optimized on the dynamic model."""
