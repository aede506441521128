"""The body's centre line: points along arcs and gaps, from which the capsule of body width is swept."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca

from srs_opt.model.kinematics import arc
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build

POINTS_PER_ARC = 6


@lru_cache(maxsize=32)
def centre_line_function(structure: Structure, samples: int) -> ca.Function:
    """Return ``(kappa (N-1, samples), p) -> (x, y) (points, samples)`` in the robot's frame, tail to head.

    The first point is link 1, the last link N; every arc is given by its ends and points between, every
    half gap by its ends. Chambers that lengthen do so with the curvature that they have; on a body that bends
    under load it is that without load, which moves points by half a millimetre at the typical size.
    """
    parameters, mechanics, _ = build(structure)
    p, kappa = parameters, mechanics.kappa
    x, y, heading = ca.SX(0), ca.SX(0), mechanics.chain.angle[0]
    xs, ys = [x], [y]
    for i in range(structure.segments):
        half_gap = (mechanics.gap_length / 2, mechanics.gap_ratio * kappa[i])
        part = mechanics.length[i] / POINTS_PER_ARC
        for length, curvature in [half_gap, *[(part, kappa[i])] * POINTS_PER_ARC, half_gap]:
            dx, dy, heading = arc(length, curvature, heading)
            x, y = x + dx, y + dy
            xs.append(x)
            ys.append(y)
    # the chain stands on its tail here; its first link tells where the tail really is
    shift_x, shift_y = mechanics.chain.x[0], mechanics.chain.y[0]
    points = (ca.vertcat(*xs) + shift_x, ca.vertcat(*ys) + shift_y)
    line = ca.Function(
        "centre_line",
        [kappa, p.vector],
        [mechanics.unloaded(v) for v in points],
        {"cse": True},
    )
    return line.map("centre_lines", "serial", samples, [1], [])
