"""Recordings of positions as camera systems export them: one reader per format, one registry."""
