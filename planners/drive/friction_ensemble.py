"""The clearance to expect, simulated with every friction and stiffness that fits what was seen.

Whatever slows a robot down or lets it slide is seen as friction, whatever yields as stiffness: after every
cycle, those members of the ensemble stay possible that predict a place near the measured one. What the driver
may do next is simulated with all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planners.drive.contact import BodyWatch
from planners.motion.robots import undelayed, with_friction_times
from planners.search.problem import Problem
from srs_opt.errors import NoAnswerError
from srs_opt.gait_opt.robust import stiffness_interval, stiffness_key
from srs_opt.geometry import wrapped
from srs_opt.model.state import POSE_AND_SPEED
from srs_opt.orbit.body import integrator
from srs_opt.robot import Robot
from srs_opt.simulate.batched import run_batched
from srs_opt.simulate.integrate import Integrator, Trajectory
from srs_opt.simulate.timeline import Timeline

Array = NDArray[np.float64]
Cycle = tuple[int, int]  # gait before, gait


@dataclass(frozen=True)
class EnsembleSettings:
    """Which frictions and stiffnesses a robot may have, and when one is thought possible.

    Attributes
    ----------
    frictions : tuple of (along, across)
        Over the planned robot's. A dragging hose acts along the wheels. Each one costs a simulation per cycle
        and per gait that is looked at.
    stiffness_times : tuple of float
        Bending stiffness over the planned one, of a soft robot whose file gives no deviation.
    stiffnesses_n_m2 : tuple of float
        Bending stiffnesses under a rigid plan: a silicone segment of the built-in robot's size has 0.002 to
        0.02.
    unlikely : float
        Squared miss with which they begin there: a body that yields though the plan says rigid is suspected
        only when no friction explains what was seen. With 0, sound robots are driven
        as carefully as soft ones.
    fading : float
        Share of what earlier cycles told that is kept, per cycle: half of it is forgotten after two.
    scales : tuple of float
        Misses of place (body lengths), heading (rad) and speed (body lengths per second) that weigh alike.
    plausible, times : float
        A member is thought possible up to this squared miss, and so many times the least one. Larger values
        keep more members, and with them more room from walls.
    enough_margins : float
        Of the margin: what leaves so much room with every possible member is good enough.
    coast_s : float
        How long a halt is simulated on after the valves have been vented. Shorter does not see a body touch
        that rolls on.
    """

    frictions: tuple[tuple[float, float], ...] = (
        (1.0, 1.0),
        (0.8, 0.8),
        (1.2, 1.2),
        (0.8, 1.0),
        (1.25, 1.0),
        (1.5, 1.0),
        (2.0, 1.0),
    )
    stiffness_times: tuple[float, ...] = (0.5, 2.0)
    stiffnesses_n_m2: tuple[float, ...] = (0.0025, 0.005, 0.012)
    unlikely: float = 1.5
    fading: float = 0.7
    scales: tuple[float, float, float, float] = (0.0424, 0.0424, 0.05, 0.212)
    plausible: float = 1.0
    times: float = 3.0
    enough_margins: float = 0.5
    coast_s: float = 1.5


DEFAULT_ENSEMBLE = EnsembleSettings()


class FrictionEnsemble:
    """Simulates what the driver thinks of doing, with every friction and stiffness that the robot may have.

    Parameters
    ----------
    problem : Problem
    settings : EnsembleSettings, optional
    """

    def __init__(self, problem: Problem, settings: EnsembleSettings = DEFAULT_ENSEMBLE) -> None:
        self.problem, self.settings = problem, settings
        robot = problem.robot
        self._scales = np.array(self.settings.scales) * (robot.length_m, robot.length_m, 1.0, robot.length_m)
        self._runs = [
            integrator(undelayed(with_friction_times(robot, *friction)), problem.gaits.model)
            for friction in self.settings.frictions
        ]
        self._runs += [
            integrator(undelayed(suspect), suspect.own_model) for suspect in _yielding(robot, settings)
        ]
        self._seen = np.zeros(len(self._runs))
        self._prior = np.zeros(len(self._runs))
        if not robot.is_soft:
            self._prior[len(self.settings.frictions) :] = self.settings.unlikely
        # how each suspect's body is bent by now, for the state that the last cycle ended with
        self._now = np.zeros(0)
        self._bends: dict[Integrator, Array] = {}

    @property
    def _misses(self) -> Array:
        return self._seen + self._prior

    @property
    def enough_m(self) -> float:
        """Clearance that is good enough."""
        return self.settings.enough_margins * self.problem.margin_m

    @property
    def likely(self) -> tuple[float, float]:
        """The friction that explains best what was seen; (1, 1) also where a stiffness does."""
        best = int(self._misses.argmin())
        return (
            self.settings.frictions[best]
            if best < len(self.settings.frictions)
            else self.settings.frictions[0]
        )

    def learn(self, before: Array, timeline: Timeline, after: Array, cycle: Cycle | None = None) -> None:
        """Take in one cycle: the state it began with and the state it ended with.

        Measured factors bend what is foreseen of a cycle (gait before, gait), here and below.
        """
        foreseen = run_batched([run.travel(timeline, self._begun(run, before)) for run in self._runs])
        bent = [
            outcome if isinstance(outcome, NoAnswerError) else self._bent(outcome, cycle)
            for outcome in foreseen
        ]
        self._seen = self.settings.fading * self._seen + [
            _miss(outcome, after, self._scales) for outcome in bent
        ]
        self._now = after.copy()
        self._bends = {
            run: outcome.final[run.layout.kappa.start : run.layout.dkappa.stop]
            for run, outcome in zip(self._runs, foreseen)
            if run.layout.compliant and not isinstance(outcome, NoAnswerError)
        }

    def _bent(self, trajectory: Trajectory, cycle: Cycle | None) -> Trajectory:
        return trajectory if cycle is None else self.problem.bent(trajectory, *cycle)

    def _begun(self, run: Integrator, state: Array) -> Array:
        """Return the planned robot's state as a suspect's model has it.

        A rigid plan's state does not know how a soft body is bent; the suspect's own last cycle does.
        """
        planned = self.problem.integrator
        if (run.layout, run.structure.model) == (planned.layout, planned.structure.model):
            return state
        begun = run.adopt(state, planned)
        if run in self._bends and np.array_equal(state, self._now):
            begun[run.layout.kappa.start : run.layout.dkappa.stop] = self._bends[run]
        return begun

    def room_m(
        self, state: Array, timeline: Timeline, suspect: int | None = None, cycle: Cycle | None = None
    ) -> float:
        """Return the smallest clearance with the likeliest suspect, or another (frictions come first).

        Minus infinity where the model cannot go on.
        """
        run = self._runs[int(self._misses.argmin()) if suspect is None else suspect]
        try:
            trajectory = self._bent(run.integrate(timeline, self._begun(run, state)), cycle)
        except NoAnswerError:
            return -math.inf
        watch = BodyWatch(self.problem, self.problem.robot, run)
        watch.look(trajectory.time_s, trajectory.pose, trajectory.kappa, ends=False)
        return watch.smallest_m

    def least_room_m(
        self, state: Array, timeline: Timeline, worth_m: float = -math.inf, cycle: Cycle | None = None
    ) -> float:
        """Return the smallest clearance with any suspect; given up at one that leaves at most `worth_m`."""
        least_m = math.inf
        possible = self._misses <= self.settings.plausible + self.settings.times * self._misses.min()
        for suspect in np.argsort(self._misses, kind="stable"):
            if possible[suspect]:
                least_m = min(least_m, self.room_m(state, timeline, int(suspect), cycle))
            if least_m <= worth_m:
                break
        return least_m


def _yielding(robot: Robot, settings: EnsembleSettings = DEFAULT_ENSEMBLE) -> list[Robot]:
    """Return robots that are softer or stiffer than the planned one, as far as it may be off."""
    if not robot.is_soft:
        return [robot.with_values(bending_stiffness_n_m2=value) for value in settings.stiffnesses_n_m2]
    if robot.relative_sd.get(stiffness_key(robot)) is not None:
        return list(stiffness_interval(robot)[1:])
    key = stiffness_key(robot)
    others = [robot.with_values(**{key: times * getattr(robot, key)}) for times in settings.stiffness_times]
    rigid = robot.with_values(bending_stiffness_n_m2=None, gap_stiffness_n_m2=None)
    return [*others, rigid]


def _miss(foreseen: Trajectory | NoAnswerError, after: Array, scales: Array) -> float:
    """Return how far a cycle ends from where it did, squared; infinity where the model could not go on."""
    if isinstance(foreseen, NoAnswerError):
        return math.inf
    off = foreseen.final[POSE_AND_SPEED] - after[POSE_AND_SPEED]
    off[2] = wrapped(off[2])
    return float(((off / scales) ** 2).sum())
