"""srs-opt: models, gaits, drive, calibration and discrepancy analysis for soft snake robots.

Heavy libraries are imported by the modules that need them, not here, so that
``import srs_opt`` and every ``--help`` stay fast.
"""

__version__ = "0.1.0"
