"""Widths over which effects are smoothed, so that the equations of motion stay differentiable."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SmoothingSettings:
    """Widths of the changes of sign and of edges in effects.

    Every width trades the sharpness of the physics against the size of the integration steps.

    Attributes
    ----------
    reversal_m_s : float
        Half the width of a change with the direction of motion, a tenth of the usual smoothing of the Coulomb
        term, which is itself near zero there. With ten times the width a trial moved by 0.08 mm.
    edge_m : float
        Of a line on the floor: the width of a wheel.
    curvature_1_m : float
        Over which the sign of the curvature changes where chambers empty more slowly than they fill: half a
        per mille of a full bend.
    """

    reversal_m_s: float = 2e-4
    edge_m: float = 0.005
    curvature_1_m: float = 0.01


@dataclass(frozen=True)
class TermSettings:
    """Limits of the generic terms.

    Attributes
    ----------
    least_lag_s : float
        Shorter lags no camera sees, and integration steps would have to be as short.
    least_play_1_m : float
        Width of a play, likewise.
    least_factor : float
        What is left of friction or load where a term would take all and more: friction of the wrong sign
        would drive the robot.
    """

    least_lag_s: float = 0.005
    least_play_1_m: float = 0.5
    least_factor: float = 0.02


SMOOTHING = SmoothingSettings()
TERM = TermSettings()
