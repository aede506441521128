"""How the camera sees the robot: markers, scale, tilt, clock. Never part of the dynamics."""

from __future__ import annotations

import casadi as ca

from srs_opt.model.effects.effect import Effect, EffectParameter, Symbols


def _marker(e: Symbols, x: ca.SX, y: ca.SX, theta: ca.SX) -> tuple[ca.SX, ca.SX]:
    c, s = ca.cos(theta), ca.sin(theta)
    return x + c * e["dx_m"] - s * e["dy_m"], y + s * e["dx_m"] + c * e["dy_m"]


def _scale(e: Symbols, x: ca.SX, y: ca.SX) -> tuple[ca.SX, ca.SX]:
    return x * (1 + e["scale"]), y * (1 + e["scale"])


def _tilt(e: Symbols, x: ca.SX, y: ca.SX) -> tuple[ca.SX, ca.SX]:
    factor = 1 + e["per_m"] * x
    return x * factor, y * factor


# In the order in which they act: marker on the link, then scale, then tilt.
EFFECTS = (
    Effect(
        "marker_offset",
        "measurement",
        (EffectParameter("dx_m", "m", 0.004), EffectParameter("dy_m", "m", 0.004)),
        marker=_marker,
    ),
    Effect(
        "camera_scale",
        "measurement",
        (EffectParameter("scale", "", 0.03, lower=-1, exclusive=True),),
        camera=_scale,
    ),
    Effect("camera_tilt", "measurement", (EffectParameter("per_m", "1/m", 0.03),), camera=_tilt),
    Effect(
        "clock_offset",
        "measurement",
        (EffectParameter("offset_s", "s", 0.03),),
        clock=lambda e: e["offset_s"],
    ),
)
