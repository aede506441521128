"""The motion table on disk: the built-in robot's comes with the package, others are made once and cached."""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import astuple, replace
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planners.motion.deviation import cycle_deviation_m
from planners.motion.settings import MOTION_TABLE
from planners.motion.table import SAMPLES, MotionTable
from planners.motion.transitions import Progress, Transitions, motion_table, simulate_transitions
from planners.motion.valves import DEFAULT_LIMITS, ValveLimits
from srs_opt.files import atomic_path
from srs_opt.gait_opt.robust import stiffness_deviation
from srs_opt.gait_opt.settings import STIFFNESS
from srs_opt.gait_opt.table import GaitTable
from srs_opt.manoeuvre.settings import REGULATOR
from srs_opt.robot import Robot
from srs_opt.simulate.compiled import cache_folder

SHIPPED = "shipped"
_POSE_STEP = 1e-4  # m and rad: below the error of interpolation, and finer digits do not compress


def table_key(robot: Robot, table: GaitTable, limits: ValveLimits = DEFAULT_LIMITS) -> str:
    """Return a hash of everything that the motion table depends on, but for the model's own equations."""
    gaits = [
        (e.gait.period_s, e.gait.pressure_kpa, e.gait.intervals, list(e.displacement)) for e in table.gaits
    ]
    joints = [*astuple(limits), REGULATOR.settle_s, REGULATOR.stair_s]
    parts = json.dumps(
        [robot.fingerprint(), table.model, MOTION_TABLE.levels, SAMPLES, MOTION_TABLE.step_s, joints, gaits],
        sort_keys=True,
    )
    return hashlib.sha256(parts.encode()).hexdigest()[:16]


def load_motion(
    robot: Robot, table: GaitTable, limits: ValveLimits = DEFAULT_LIMITS, progress: Progress = iter
) -> MotionTable:
    """Return the motion table: shipped, cached, or simulated now (about half a minute) and then cached."""
    key = table_key(robot, table, limits)
    shipped = resources.files("planners.motion") / SHIPPED / f"{key}.npz"
    cached = cache_folder() / f"motion_{key}_{_equations_digest()}.npz"
    transitions = None
    for place in (Path(str(shipped)), cached):
        transitions = transitions or _read(place, len(table.gaits), robot.segments)
    if transitions is None:
        transitions = rounded(simulate_transitions(robot, table, limits, progress))
        write_transitions(cached, transitions)
    motion = motion_table(robot, table, transitions, limits)
    return replace(motion, deviation_m=_load_deviation(robot, table, key))


def _load_deviation(robot: Robot, table: GaitTable, key: str) -> NDArray[np.float64] | None:
    """Return what `cycle_deviation_m` finds, cached as the motion table is."""
    if stiffness_deviation(robot) < STIFFNESS.least_sd:
        return None
    cached = cache_folder() / f"deviation_{key}_{stiffness_deviation(robot):.4g}_{_equations_digest()}.npz"
    try:
        with np.load(io.BytesIO(cached.read_bytes())) as stored:
            found = np.array(stored["deviation_m"])
        if found.shape == (len(table.gaits) + 1,) and np.isfinite(found).all():
            return found
    except Exception:  # as in `_read`
        pass
    deviation_m = cycle_deviation_m(robot, table)
    if deviation_m is not None:
        with atomic_path(cached) as temporary:
            np.savez_compressed(temporary, deviation_m=deviation_m)
    return deviation_m


def rounded(transitions: Transitions) -> Transitions:
    """Return the transitions as they are stored, so that plans made before and after storing are the same."""
    coarse = {
        name: (np.round(value / _POSE_STEP) * _POSE_STEP).astype(value.dtype)
        for name, value in transitions._asdict().items()
        if name != "kappa"
    }
    return Transitions(**coarse, kappa=np.round(transitions.kappa, 3).astype(np.float32))


def write_transitions(path: Path, transitions: Transitions) -> Path:
    """Write simulated transitions as a compressed archive, rounded, atomically."""
    with atomic_path(path) as temporary:
        np.savez_compressed(temporary, **rounded(transitions)._asdict())
    return path


def _read(path: Path, gaits: int, segments: int) -> Transitions | None:
    """Return the stored transitions, or None where there is no file or a broken one (it is made again)."""
    try:
        # by way of memory: numpy leaves the file open when the archive is broken
        with np.load(io.BytesIO(path.read_bytes())) as stored:
            found = Transitions(*(stored[name] for name in Transitions._fields))
    except Exception:  # what a damaged archive raises is the business of zipfile, zlib, numpy and ast
        return None
    after_each = all(len(array) in (gaits, gaits + 1) and np.isfinite(array).all() for array in found)
    return found if after_each and found.kappa.shape[1::2] == (gaits, segments) else None


def _equations_digest() -> str:
    """Return a hash of the sources that make the model's motion."""
    import srs_opt

    digest = hashlib.sha256()
    package = Path(srs_opt.__file__).parent
    for folder in ("model", "simulate"):
        for file in sorted((package / folder).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:8]
