"""Truths drawn at random: how large, which way, where, and what the bench got wrong."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from virtual_lab.catalogue import EffectKind, find_kind
from virtual_lab.robot_file import WPI_SRS, RobotFile
from virtual_lab.truth import USUAL_SCATTER, Scatter, Truth

BENCH_SD: Mapping[str, float] = {
    "friction_tangential": 0.05,
    "friction_normal": 0.05,
    "curvature_per_pressure_1_m_kpa": 0.03,
    "tau1_s": 0.05,
    "tau2_s": 0.05,
}


def draw_effect(
    kind: EffectKind, rng: np.random.Generator, links: int, scale_range: tuple[float, float] = (0.7, 1.4)
) -> dict[str, float | int | str]:
    """Draw size, sign and place of one effect.

    The size is uniform in `scale_range` times the typical one; links, segments and directions are uniform;
    an anchor stands 0.7 to 2 m from the room's origin.
    """
    size = kind.typical * rng.uniform(*scale_range)
    if kind.signed and rng.random() < 0.5:
        size = -size
    effect: dict[str, float | int | str] = {"name": kind.name, kind.size: float(size), **kind.scales}
    if "ax_m" in kind.parameters:
        away, bearing = rng.uniform(0.7, 2.0), rng.uniform(-math.pi, math.pi)
        effect |= {"ax_m": float(away * math.cos(bearing)), "ay_m": float(away * math.sin(bearing))}
    if "direction" in kind.parameters:
        effect["direction"] = float(rng.uniform(-math.pi, math.pi))
    if "dy_m" in kind.parameters:
        bearing = rng.uniform(-math.pi, math.pi)
        effect |= {"dx_m": float(abs(size) * math.cos(bearing)), "dy_m": float(abs(size) * math.sin(bearing))}
    if "segment" in kind.parameters:
        effect["segment"] = int(rng.integers(1, links))
    if "link" in kind.parameters:
        effect["link"] = int(rng.integers(1, links + 1))
    return effect


def draw_truth(
    names: str | tuple[str, ...] | list[str],
    rng: np.random.Generator,
    scale_range: tuple[float, float] = (0.7, 1.4),
    *,
    robot: RobotFile = WPI_SRS,
    bench_error: float = 1.0,
    scatter: Scatter = USUAL_SCATTER,
) -> Truth:
    """Draw a laboratory in which the named effects are hidden.

    Parameters
    ----------
    names : str or sequence of str
        Listed or unlisted effects; ``"none"`` or empty for none; ``"a+b"`` for two.
    rng : numpy.random.Generator
    scale_range : pair of float
        Sizes over typical ones.
    robot : RobotFile
        What the robot file says; how well it claims to know it adds to BENCH_SD.
    bench_error : float
        The true values differ from the bench by normal errors of this many of its standard deviations
        (0: the bench is right), cut at two standard deviations each.
    scatter : Scatter
        Trial-to-trial scatter.

    Raises
    ------
    LabError
        For a name that is no effect.
    """
    words = names.split("+") if isinstance(names, str) else list(names)
    kinds = [find_kind(word) for word in words if word not in ("", "none")]
    bench, sds = robot.parameters, {**BENCH_SD, **robot.relative_sd}
    errors = np.clip(rng.standard_normal(len(sds)), -2.0, 2.0) * bench_error
    factors = np.maximum(1.0 + np.array(list(sds.values())) * errors, 0.05)
    changes = {k: getattr(bench, k) * float(f) for k, f in zip(sds, factors)}
    drawn = [(kind.listed, draw_effect(kind, rng, bench.links, scale_range)) for kind in kinds]
    return Truth(
        parameters=dataclasses.replace(bench, **changes),
        effects=(*robot.effects, *(e for listed, e in drawn if listed)),
        unlisted=tuple(effect for listed, effect in drawn if not listed),
        scatter=scatter,
        bench=bench,
        relative_sd=sds,
        documented={**robot.other, "effects": [dict(e) for e in robot.effects]},
    )
