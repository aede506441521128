"""The snake as a differential drive: reachable motions, their gaits, calibration against measurements."""
