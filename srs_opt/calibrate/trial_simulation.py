"""Simulate one trial on an adapted mesh: the states at the mesh's nodes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from srs_opt.calibrate.initial_pose import initial_pose
from srs_opt.calibrate.model import Conditions, Model, Packed, Values
from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait, Wave
from srs_opt.measurement.records import Applied, Schedule, Trial
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import state_layout
from srs_opt.model.state import BODY, POSE, StateLayout
from srs_opt.simulate.adaptive import NonFiniteMotionError, adapted
from srs_opt.simulate.batched import Search, StepRequest, run_one
from srs_opt.simulate.integrate import step_kernel
from srs_opt.simulate.kernel import Kernel
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.settings import INTEGRATION, MeshSettings
from srs_opt.simulate.timeline import Timeline


@dataclass(frozen=True)
class TrialSettings:
    """How finely trials are simulated, and how far beyond their last label.

    Attributes
    ----------
    tolerance_m_s : float
        Local error of the body's speed per step; 5e-6 keeps the track within about 0.01 mm, well below what a
        thousand frames of markers with 1 mm of noise can see.
    finest_m_s : float
        Finest tolerance that long takes with little noise may ask for; below, rounding counts.
    first_step_s : float
        First guess of the steps.
    tail_s : float
        Simulated beyond the last label, for clocks that run late.
    fastest_clock : float
        Times as long beyond it, where clocks may run fast.
    latest_marker_s : float
        By which a marker may be seen later than the one before it.
    trials_at_once : int
        Whose motions are in memory together: enough to fill the lanes of the compiled code.
    most_kept_values : int
        Measured values up to which derivatives and motions are kept: some 300 MB.
    """

    tolerance_m_s: float = 5e-6
    finest_m_s: float = 2e-7
    first_step_s: float = 0.005
    tail_s: float = 0.05
    fastest_clock: float = 0.03
    latest_marker_s: float = 0.03
    trials_at_once: int = 48
    most_kept_values: int = 1_200_000


TRIAL = TrialSettings()
# A mesh from where the motion nearly broke down would slow all that follow: it is made anew. A trial whose
# parameters are out of range is given up at once, because a fit tries many.
TRIAL_MESH = MeshSettings(accepted=15.0, free_attempts=12, attempts=12, halvings=0, wasteful=0.3)
SAME_S = 1e-12  # durations of phases nearer than this are the same, and differ by rounding
# (tolerance, cycle) -> what the valves did, and the mesh that served
Meshes = dict[tuple[float, int], tuple[tuple[float, ...], Mesh]]


@dataclass(frozen=True)
class Nodes:
    """States at the nodes of one trial's mesh.

    Attributes
    ----------
    time_s : array (n + 1,)
    body : array (n + 1, 6)
        Pose, then velocity in the robot's frame and yaw momentum.
    kappa, dkappa, no_load, no_load_rate : array (n + 1, N-1)
        Of the body, and those that the actuators would give without load.
    start : array (nx,)
        The whole state at the first node.
    valve : array (n, N-1)
        Held over each step.
    p, camera : array
        Packed parameters of the full structure, and of what the camera sees.
    clock_s, clock_rate : float
        The sample labelled t was taken at t (1 + clock_rate) + clock_s.
    marker_lag_s : float
        By how much later every marker is seen than the one before it.
    """

    time_s: np.ndarray
    body: np.ndarray
    kappa: np.ndarray
    dkappa: np.ndarray
    no_load: np.ndarray
    no_load_rate: np.ndarray
    start: np.ndarray
    valve: np.ndarray
    p: np.ndarray
    camera: np.ndarray
    clock_s: float
    clock_rate: float = 0.0
    marker_lag_s: float = 0.0

    def shape(self, layout: StateLayout) -> np.ndarray:
        """Return the body's shape (n + 1, ...) as `layout` has it."""
        return np.concatenate([self.kappa, self.no_load], axis=1)[:, : len(layout.shape)]

    def shape_rate(self, layout: StateLayout) -> np.ndarray:
        """Return the rates of the body's shape (n + 1, ...)."""
        return np.concatenate([self.dkappa, self.no_load_rate], axis=1)[:, : len(layout.shape)]


def tolerance_for(values: int, sd_m: float) -> float:
    """Return the tolerance whose errors that many measured values with noise `sd_m` cannot see.

    An error of the track counts as its square, over the noise's, times the number of values.
    """
    # the default serves 15,000 values with 1 mm of noise; what shows grows with the root of their number
    needed = TRIAL.tolerance_m_s * (sd_m / 0.001) * math.sqrt(15_000 / max(values, 1))
    return min(TRIAL.tolerance_m_s, max(TRIAL.finest_m_s, needed))


def timeline_of(
    trial: Trial, segments: int, fastest_clock: float = 0.0, latest_marker_s: float = 0.0
) -> Timeline:
    """Return what the valves do in a trial, a little longer than it was recorded."""
    end = float(trial.time_s[-1]) * (1 + fastest_clock) + TRIAL.tail_s + latest_marker_s
    if trial.kind == "still":
        return Timeline.vent(segments, end, trial.pressure_kpa)
    if trial.applied is not None:
        return _applied(trial.applied, end, trial)
    if trial.schedule is not None:
        return _scheduled(trial.schedule, segments, end, trial)
    wave = Wave.uniform(segments, trial.frequency_hz, trial.pressure_kpa, trial.phase_lag_rad, trial.offset)
    return Timeline.of_gait(wave.gait(), end)


def _applied(applied: Applied, end_s: float, trial: Trial) -> Timeline:
    """Play what was recorded; its last row holds until the end.

    A trial has one pressure among the equations' parameters. Curvature follows pressure times S, so that what
    the regulator did goes into S, a share of the trial's pressure.
    """
    within = applied.time_s < end_s - 1e-9
    durations = np.diff(np.append(applied.time_s[within], end_s))
    # S in (13) times the pressure is all that (15) knows
    share = applied.pressure_kpa[within] / trial.pressure_kpa if trial.pressure_kpa > 0 else 0.0
    valve = (applied.state[within] * np.reshape(share, (-1, 1))).T
    return Timeline.constant(durations, valve, trial.pressure_kpa, trial.frequency_hz or 1.0)


def _scheduled(schedule: Schedule, segments: int, end_s: float, trial: Trial) -> Timeline:
    """Play a schedule from its start."""
    period = schedule.period_s
    inner = {t % period for _, on, off in schedule.intervals for t in (on, off)}
    cycle = np.array(sorted({0.0, *inner}))
    starts = (np.arange(math.ceil(end_s / period))[:, None] * period + cycle).ravel()
    starts = starts[starts < end_s - 1e-9]
    durations = np.diff(np.append(starts, end_s))
    # asked in the middle of a phase, where rounding of its edges does not matter
    middles = starts + durations / 2
    valve = np.stack([schedule.state(i, middles) for i in range(1, segments + 1)])
    frequency = trial.frequency_hz if trial.frequency_hz > 0 else 1 / period
    return Timeline.constant(durations, valve, trial.pressure_kpa, frequency)


def conditions_of(trial: Trial) -> Conditions:
    """Return the trial's conditions as the equations see them."""
    # effects that depend on the frequency need a number where there is none
    return Conditions(trial.pressure_kpa, trial.frequency_hz or 1.0, trial.tether)


class TrialRun:
    """One trial, ready to be simulated at any values; keeps the last mesh as a start for the next."""

    def __init__(self, model: Model, trial: Trial) -> None:
        self.model, self.trial = model, trial
        self.conditions = conditions_of(trial)
        fastest = TRIAL.fastest_clock if model.clock_drifts else 0.0
        latest_s = TRIAL.latest_marker_s * model.segments if model.markers_lag else 0.0
        self.timeline = timeline_of(trial, model.segments, fastest, latest_s)
        self.meshes: Meshes = {}

    def __call__(self, values: Values, tolerance_m_s: float | None = None) -> Nodes:
        """Simulate the trial; the local error of the body's speed is by default that of `TrialSettings`.

        Raises
        ------
        NoAnswerError
            If the motion becomes non-finite.
        """
        return run_one(self.search(values, tolerance_m_s))

    def search(
        self, values: Values, tolerance_m_s: float | None = None, attempts: int | None = None
    ) -> Search[Nodes]:
        """Do what a call does, as a search: see `simulate.batched` for many trials at once.

        With a single one of `attempts` the last meshes serve as they are.
        """
        tolerance_m_s = TRIAL.tolerance_m_s if tolerance_m_s is None else tolerance_m_s
        structure, kept = self.model.structure(values)
        packed = self.model.pack(values, self.conditions)
        p = packed.p
        timeline = self.timeline.delayed(float(packed.delay_s[0]) + self.model.robot.valve_delay_s)
        x = self._start(structure, p)
        states, valves, steps = [x[:, None]], [], []
        kernel = step_kernel(structure)
        for number, piece in enumerate(_cycles(timeline, self.trial.period_s)):
            new, mesh = yield from self._piece((tolerance_m_s, number), kernel, x, piece, p[kept], attempts)
            x = new[:, -1]
            states.append(new)
            valves.append(piece.valve[:, mesh.phase])
            steps.append(mesh.h_s)
        return _nodes(
            state_layout(structure),
            np.concatenate(states, axis=1),
            np.concatenate(valves, axis=1),
            np.concatenate(steps),
            packed,
        )

    def _start(self, structure: Structure, p: np.ndarray) -> np.ndarray:
        x = np.zeros(state_layout(structure).size)
        x[POSE] = initial_pose(self.model.full, p, self.trial.heading_rad)[0]
        return x

    def _piece(
        self,
        key: tuple[float, int],
        kernel: Kernel,
        x: np.ndarray,
        piece: Timeline,
        p: np.ndarray,
        attempts: int | None,
    ) -> Search[tuple[np.ndarray, Mesh]]:
        """Integrate one cycle on the mesh that served it last time, refined where that is too coarse."""
        phases = (*np.round(piece.duration_s, 7), *piece.valve.ravel())
        tolerance, number = key
        # this cycle the last time it was simulated, else the cycle before it
        kept = self.meshes.get(key) or self.meshes.get((tolerance, number - 1))
        mesh = _fitted(kept, piece.duration_s, phases) or Mesh.uniform(piece.duration_s, TRIAL.first_step_s)
        request = StepRequest(kernel, x, mesh, piece.valve, p)
        try:
            got = yield from adapted(request, tolerance, TRIAL_MESH, attempts=attempts)
        except NonFiniteMotionError:
            raise NoAnswerError(
                "the simulated motion of a trial becomes non-finite; effect sizes out of range"
            ) from None
        self.meshes[key] = (phases, got.mesh)
        return got.states, got.mesh


def _fitted(
    kept: tuple[tuple[float, ...], Mesh] | None, duration_s: np.ndarray, phases: tuple[float, ...]
) -> Mesh | None:
    """Return a kept mesh when it belongs to the same valve pattern, stretched to the phases' durations."""
    if kept is None or len(kept[0]) != len(phases):
        return None
    count = duration_s.size
    if kept[0][count:] != phases[count:]:
        return None
    mesh = kept[1]
    known_s = np.bincount(mesh.phase, mesh.h_s, minlength=count)
    # The same motion again is the same to the last bit. Sums of steps are rounded like the times that they
    # are differences of, whatever the length of the phase: a share of a short phase would not do.
    if np.abs(duration_s - known_s).max() < SAME_S:
        return mesh
    return Mesh(mesh.h_s * (duration_s / known_s)[mesh.phase], mesh.phase)


def _cycles(timeline: Timeline, period_s: float) -> list[Timeline]:
    """Cut a timeline at whole periods, so that cycles share meshes."""
    ends = np.cumsum(timeline.duration_s)
    pieces, start = [], 0
    boundary = period_s
    for k, end in enumerate(ends):
        if end >= boundary - 1e-9 or k - start >= INTEGRATION.longest_phases or k == ends.size - 1:
            pieces.append(timeline.part(slice(start, k + 1)))
            start = k + 1
            # the next whole period, where this end is one but for rounding, too
            boundary = (math.floor((end + 1e-9) / period_s) + 1) * period_s
    return pieces


def _nodes(
    layout: StateLayout, states: np.ndarray, valve: np.ndarray, h_s: np.ndarray, packed: Packed
) -> Nodes:
    free = states[layout.actuator]
    return Nodes(
        time_s=np.concatenate([[0.0], np.cumsum(h_s)]),
        body=states[BODY].T,
        kappa=states[layout.kappa].T,
        dkappa=states[layout.dkappa].T,
        no_load=free[: layout.segments].T,
        no_load_rate=free[layout.segments : 2 * layout.segments].T,
        start=states[:, 0],
        valve=valve.T,
        p=packed.p,
        camera=packed.camera,
        clock_s=float(packed.clock_s[0]),
        clock_rate=float(packed.clock_rate[0]),
        marker_lag_s=float(packed.marker_lag_s[0]),
    )


__all__ = ["Gait", "Nodes", "TrialRun", "conditions_of", "timeline_of"]
