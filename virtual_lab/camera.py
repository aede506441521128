"""What the camera sees of a run: markers, its own errors, noise, lost markers."""

from __future__ import annotations

import math

import numpy as np

from virtual_lab.assemble import NOMINAL, Factors
from virtual_lab.simulate import Run, run
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth


def label_times(duration_s: float, rate_hz: float) -> np.ndarray:
    """Return the labels of the samples, 0, 1/rate, ... below `duration_s`."""
    return np.arange(max(math.ceil(duration_s * rate_hz - 1e-6), 1)) / rate_hz


def true_times(truth: Truth, labels: np.ndarray) -> np.ndarray:
    """Return when each marker was really seen, (T, N), for samples with these labels."""
    hidden = dict(truth.hidden())
    seen = labels * (1.0 + hidden.get("clock_drift", {}).get("per_s", 0.0))
    seen = seen + hidden.get("clock_offset", {}).get("offset_s", 0.0)
    row = hidden.get("rolling_shutter", {}).get("delay_s", 0.0)
    return seen[:, None] + row * np.arange(truth.parameters.links)[None, :]


def picture(truth: Truth, trial: Trial, labels: np.ndarray, factors: Factors = NOMINAL) -> np.ndarray:
    """Return the markers in the camera's coordinates without noise, (T, N, 2)."""
    return to_camera(truth, marker_places(truth, trial, labels, factors)[0], labels)


def centre_picture(truth: Truth, trial: Trial, labels: np.ndarray, factors: Factors = NOMINAL) -> np.ndarray:
    """Return the mass-weighted centre of the markers in the camera's coordinates, (T, 1, 2)."""
    places, what = marker_places(truth, trial, labels, factors)
    centre = np.einsum("tnc,n->tc", places, what.mass / what.mass.sum())
    return to_camera(truth, centre[:, None, :], labels)


def marker_places(truth: Truth, trial: Trial, labels: np.ndarray, factors: Factors) -> tuple[np.ndarray, Run]:
    """Return where each marker is in the room when the camera sees it, (T, N, 2), and the run behind it."""
    when = true_times(truth, labels)
    links = truth.parameters.links
    rolling = bool(np.ptp(when[0]) > 0)
    what = run(truth, trial, when.ravel() if rolling else when[:, 0], factors)
    x, y, theta = what.x, what.y, what.theta
    if rolling:
        own = np.arange(links)
        x, y, theta = (a.reshape(len(labels), links, links)[:, own, own] for a in (x, y, theta))
    hidden = dict(truth.hidden())
    offset = hidden.get("marker_offset", {"dx_m": 0.0, "dy_m": 0.0})
    dx, dy = offset["dx_m"], offset["dy_m"]
    cos, sin = np.cos(theta), np.sin(theta)
    return np.stack([x + cos * dx - sin * dy, y + sin * dx + cos * dy], axis=2), what


def to_camera(truth: Truth, places: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Return places in the room, (T, K, 2), as the camera reports them."""
    hidden = dict(truth.hidden())
    places = places * (1.0 + hidden.get("camera_scale", {}).get("scale", 0.0))
    places = places * (1.0 + hidden.get("camera_tilt", {}).get("per_m", 0.0) * places[..., :1])
    if "lens_barrel" in hidden:
        places = places * (1.0 + hidden["lens_barrel"]["per_m2"] * np.sum(places**2, axis=-1, keepdims=True))
    if "swaying_camera" in hidden:
        sway = hidden["swaying_camera"]
        swing = sway["amplitude_m"] * np.sin(2 * math.pi * sway["frequency_hz"] * labels)
        towards = np.array([math.cos(sway["direction"]), math.sin(sway["direction"])])
        places = places + swing[:, None, None] * towards
    return places


def measured(places: np.ndarray, sd_m: float, lost: float, rng: np.random.Generator) -> np.ndarray:
    """Return the places with noise, and NaN where a marker was lost (probability `lost` each)."""
    noisy = places + sd_m * rng.standard_normal(places.shape)
    noisy[rng.random(places.shape[:2]) < lost] = np.nan
    return noisy
