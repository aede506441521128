"""Calibration: one fit of all trials, bench values as priors, trial-to-trial scatter as a random effect."""
