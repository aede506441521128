"""Calibration: one fit of all trials, bench values as priors, trial-to-trial scatter as a random effect."""

from srs_opt.callable_package import make_callable

make_callable(__name__, "srs_opt.calibrate.run", "calibrate")
