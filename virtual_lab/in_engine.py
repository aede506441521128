"""Trials run in a physics engine: the laboratory's robot as bodies, joints, wheels and springs.

Valves, pressure and silicone are the laboratory's own: they give the curvatures without load, which the
hinges follow. Everything that touches the floor or is heavy is the engine's.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from dart_snake.body import Body, Link
from dart_snake.engine import Pull, Snake
from virtual_lab import kernel, soft
from virtual_lab.assemble import Factors, Tables, assemble, hidden_effects
from virtual_lab.errors import LabError
from virtual_lab.simulate import Run, sample
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth

STEP_S = 1e-3
TETHER_SPEED_M_S = 1e-3  # below which a dragging tether pulls less
# what the engine's bodies do not have: friction beyond Coulomb's, floors and wheels that depend on place or
# bend
UNABLE = (
    "gap_bending", "stribeck", "reverse_friction", "slip_rate", "quadratic_drag", "carpet_edge",
    "floor_waves", "sideways_stiction", "chamber_stretch", "bend_unloads", "bend_steers",
)  # fmt: skip


def run_in_engine(
    truth: Truth, trial: Trial, times: np.ndarray, factors: Factors, step_s: float = STEP_S
) -> Run:
    """Run a trial from rest in the engine and look at the robot at `times` (seconds, in any order).

    Raises
    ------
    LabError
        The engine is missing, or cannot represent an effect.
    """
    if importlib.util.find_spec("dartpy") is None:
        raise LabError("--engine dart needs the package 'dartpy' (wheels for Linux): pip install '.[judge]'")
    hidden = hidden_effects(truth, trial)
    if unable := [name for name in hidden if name in UNABLE]:
        raise LabError(f"--engine dart cannot represent {', '.join(unable)}")
    if truth.parameters.friction_law != "per_axis":
        raise LabError("--engine dart rolls on wheels, which is friction_law per_axis")
    end_s = max(float(np.max(times)), step_s) + step_s
    steps = math.ceil(end_s / step_s)
    grid = np.arange(steps + 1) * step_s
    tables = assemble(truth, trial, float(grid[-1]) + 1e-3, factors)
    segments = truth.parameters.links - 1
    without_load = replace(tables, segments=None)
    at_rest = np.array([0.0, 0.0, trial.heading_rad, 0.0, 0.0, 0.0])
    bends = sample(without_load, at_rest, np.zeros((segments, 4)), grid)
    kappa, rate = bends[:, 6 : 6 + segments], bends[:, 6 + segments : 6 + 2 * segments]
    body = _body(truth, tables, hidden)
    half, heading = body.half_length_m, trial.heading_rad
    slope = hidden.get("floor_slope", {"angle": 0.0, "direction": 0.0})
    snake = Snake(
        body, (half * math.cos(heading), half * math.sin(heading), heading), step_s=step_s,
        slope=(slope["angle"], slope["direction"]), pull=_pull(hidden),
    )  # fmt: skip
    before, seen = snake.look(), snake.play(kappa[1:], rate[1:])
    lengths = np.asarray(tables.lengths)

    def rows(key: str) -> np.ndarray:
        whole = np.concatenate([getattr(before, key), getattr(seen, key)])
        return np.stack([np.interp(times, grid, column) for column in whole.T], axis=1)

    x, y, theta, bend = (rows(key) for key in ("x_m", "y_m", "theta_rad", "bend_rad"))
    bent = np.concatenate([before.bend_rad, seen.bend_rad]) / lengths
    bend_rate = np.gradient(bent, grid, axis=0)
    tail = np.stack(
        [
            np.concatenate([getattr(before, k)[:, 0], getattr(seen, k)[:, 0]])
            for k in ("x_m", "y_m", "theta_rad")
        ],
        axis=1,
    )
    velocity = np.gradient(tail, grid, axis=0)
    return Run(
        np.asarray(times, dtype=float),
        x,
        y,
        theta,
        bend / lengths,
        np.stack([np.interp(times, grid, column) for column in bend_rate.T], axis=1),
        np.stack([np.interp(times, grid, column) for column in velocity.T], axis=1),
        tables.links[:, kernel.MASS].copy(),
    )


def _body(truth: Truth, tables: Tables, hidden: Mapping[str, Mapping[str, float]]) -> Body:
    """Return the robot of the tables as the engine's bodies."""
    p = truth.parameters
    damping = hidden.get("viscous_rolling", {}).get("damping", 0.0)
    links = [
        Link(
            mass_kg=float(row[kernel.MASS]),
            inertia_kg_m2=float(row[kernel.INERTIA]),
            axle_friction=float(row[kernel.MU_T]),
            tyre_friction=float(row[kernel.MU_N]),
            axle_damping_n_s_m=damping,
            load_n=float(row[kernel.LOAD] - row[kernel.MASS] * p.gravity_m_s2),
            toe_rad=float(row[kernel.TOE]),
        )
        for row in tables.links
    ]
    if "seized_wheel" in hidden and hidden["seized_wheel"]["seized"]:
        k = int(hidden["seized_wheel"]["link"]) - 1
        links[k] = replace(links[k], seized=True)
    if "loose_wheel" in hidden:
        k = int(hidden["loose_wheel"]["link"]) - 1
        links[k] = replace(links[k], play_m=hidden["loose_wheel"]["play_m"])
    flexibility = hidden.get("bending_compliance", {}).get("flexibility", 0.0)
    if p.bending_stiffness_n_m2 is not None:
        flexibility += 1 / p.bending_stiffness_n_m2
    return Body(
        tuple(links),
        tuple(float(length) for length in tables.lengths),
        float(tables.ground[kernel.GAP]),
        gravity_m_s2=p.gravity_m_s2,
        stiffness_n_m2=1 / flexibility if flexibility else None,
        gap_stiffness_n_m2=p.gap_stiffness_n_m2,
        relaxation_s=0.0 if tables.segments is None else float(tables.segments[0, soft.RELAXATION]),
    )


def _pull(hidden: Mapping[str, Mapping[str, float]]) -> Pull | None:
    """Return what hose and tether do to the tail link."""
    names = ("tether_drag", "tether_viscous", "tether_pull", "hose_spring", "hose_torsion")
    if not any(name in hidden for name in names):
        return None
    drag = hidden.get("tether_drag", {}).get("force_n", 0.0)
    damping = hidden.get("tether_viscous", {}).get("damping", 0.0)
    torque = hidden.get("hose_torsion", {}).get("torque_n_m", 0.0)
    anchor = hidden.get("tether_pull", {"force_n": 0.0, "ax_m": 0.0, "ay_m": 0.0})
    hose = hidden.get("hose_spring", {"stiffness": 0.0, "ax_m": 0.0, "ay_m": 0.0, "slack_m": 0.0})

    def pull(_: float, x: float, y: float, vx: float, vy: float) -> tuple[float, float, float]:
        brake = damping + drag / math.sqrt(vx * vx + vy * vy + TETHER_SPEED_M_S**2)
        fx, fy = -brake * vx, -brake * vy
        dx, dy = anchor["ax_m"] - x, anchor["ay_m"] - y
        share = anchor["force_n"] / max(math.hypot(dx, dy), 1e-9)
        fx, fy = fx + share * dx, fy + share * dy
        dx, dy = hose["ax_m"] - x, hose["ay_m"] - y
        away = max(math.hypot(dx, dy), 1e-9)
        share = hose["stiffness"] * max(away - hose["slack_m"], 0.0) / away
        return fx + share * dx, fy + share * dy, torque

    return pull
