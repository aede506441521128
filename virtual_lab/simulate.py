"""Run one trial of the true robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_lab import kernel, soft
from virtual_lab.assemble import NOMINAL, Factors, Tables, assemble
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth


@dataclass(frozen=True)
class Run:
    """What really happened, at T times.

    Attributes
    ----------
    times : (T,) array
        Seconds since the valve wave started.
    x, y, theta : (T, N) arrays
        Places (m) and headings (rad) of the links in the room, tail to head.
    kappa, kappa_rate : (T, N-1) arrays
        Curvatures (1/m) and their rates.
    tail_velocity : (T, 3) array
        Velocity (m/s) and turn rate (rad/s) of the tail.
    mass : (N,) array
        Masses of the links (kg).
    """

    times: np.ndarray
    x: np.ndarray
    y: np.ndarray
    theta: np.ndarray
    kappa: np.ndarray
    kappa_rate: np.ndarray
    tail_velocity: np.ndarray
    mass: np.ndarray

    def centre_of_mass(self) -> np.ndarray:
        """Return the mass-weighted mean place of the links, (T, 2)."""
        return np.stack([self.x @ self.mass, self.y @ self.mass], axis=1) / self.mass.sum()


def run(
    truth: Truth, trial: Trial, times: np.ndarray, factors: Factors = NOMINAL, *, refine: float = 1.0
) -> Run:
    """Run a trial from rest and look at the robot at `times`.

    The robot starts straight, all links at the trial's heading, its tail at the room's origin; before
    time 0 it lies still.

    Parameters
    ----------
    truth, trial : Truth, Trial
    times : (T,) array
        Seconds, in any order.
    factors : Factors
        This trial's friction and curvature over the robot's.
    refine : float
        Steps this many times finer than stability asks.

    Raises
    ------
    LabError
        The effects contradict each other or the robot.
    """
    if truth.engine == "dart":
        from virtual_lab.in_engine import run_in_engine

        return run_in_engine(truth, trial, np.asarray(times, dtype=float), factors)
    order, back = np.unique(np.asarray(times, dtype=float), return_inverse=True)
    end_s = max(float(order[-1]), 0.0) + 1e-3
    tables = assemble(truth, trial, end_s, factors, refine)
    state = rest_state(tables, trial.heading_rad)
    shape = np.zeros((truth.parameters.links - 1, 4))
    return look(tables, sample(tables, state, shape, order)[back], np.asarray(times, dtype=float))


def sample(tables: Tables, state: np.ndarray, shape: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Integrate from a state of tail and segments; return samples at increasing times.

    Afterwards `shape` is that of the segments at the tables' end, what they remember included.

    Rows are pose and velocity of the tail, curvatures, their rates; of a body that bends under load, whose
    state holds its bends and their rates as well, then no-load curvatures and their rates.
    """
    t = tables
    rest = t.links, t.ground, times
    if t.segments is None:
        return kernel.integrate(
            state, shape, t.edges, t.steps, t.push, t.sign, t.bias, t.bend, t.lengths, *rest
        )
    return soft.integrate(state, shape, t.edges, t.steps, t.push, t.sign, t.bias, t.bend, t.segments, *rest)


def rest_state(tables: Tables, heading_rad: float) -> np.ndarray:
    """Return the state of the straight robot at rest, its tail at the origin."""
    bends = 0 if tables.segments is None else 2 * len(tables.segments)
    state = np.zeros(6 + bends)
    state[2] = heading_rad
    return state


def look(tables: Tables, samples: np.ndarray, times: np.ndarray) -> Run:
    """Return places and headings of all links from the tail's pose and the curvatures."""
    n = len(tables.lengths)
    kappa = samples[:, 6 : 6 + n]
    x, y, theta = (np.empty((len(samples), n + 1)) for _ in range(3))
    x[:, 0], y[:, 0], theta[:, 0] = samples[:, 0], samples[:, 1], samples[:, 2]
    gap, ratio = tables.ground[kernel.GAP], tables.ground[kernel.GAP_RATIO]
    no_load = kappa if tables.segments is None else samples[:, 6 + 2 * n : 6 + 3 * n]
    for s, natural in enumerate(tables.lengths):
        length = natural * (1.0 + tables.bend[kernel.STRETCH] * no_load[:, s] ** 2)
        arc = np.sinc(0.5 * length * kappa[:, s] / np.pi) * length
        tilt = 0.25 * ratio * gap * kappa[:, s]  # a half gap's chord against its link
        turn = (length + ratio * gap) * kappa[:, s]
        distance = arc + gap * np.sinc(tilt / np.pi) * np.cos(0.5 * turn - tilt)
        x[:, s + 1] = x[:, s] + distance * np.cos(theta[:, s] + 0.5 * turn)
        y[:, s + 1] = y[:, s] + distance * np.sin(theta[:, s] + 0.5 * turn)
        theta[:, s + 1] = theta[:, s] + turn
    rates = samples[:, 6 + n : 6 + 2 * n]
    return Run(times, x, y, theta, kappa, rates, samples[:, 3:6], tables.links[:, kernel.MASS].copy())
