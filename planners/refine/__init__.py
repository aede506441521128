"""Certified plans made faster: valve switches, cycle ends and pressures optimized on the dynamic model."""
