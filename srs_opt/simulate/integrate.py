"""Integration of the model over a timeline, adaptive, every step ending at or before a valve switch."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np

from srs_opt.errors import InputError, NoAnswerError
from srs_opt.model.parameters import Structure, valve_delay_s
from srs_opt.model.registry import build, state_layout
from srs_opt.model.state import POSE, VELOCITY, WORK, YAW_MOMENTUM, StateLayout
from srs_opt.model.yaw import yaw_momenta
from srs_opt.robot import Robot
from srs_opt.simulate.adaptive import NonFiniteMotionError, adapted, finite_steps
from srs_opt.simulate.batched import Search, StepRequest, run_one
from srs_opt.simulate.kernel import Kernel
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.rosenbrock import step_function
from srs_opt.simulate.settings import INTEGRATION
from srs_opt.simulate.timeline import Timeline


@lru_cache(maxsize=32)
def step_kernel(structure: Structure) -> Kernel:
    """Return the compiled `step_function`."""
    parameters, _, _ = build(structure)
    sizes = (state_layout(structure).size, structure.segments, parameters.vector.numel())
    return Kernel(f"step {structure}", sizes, lambda: step_function(structure))


@dataclass(frozen=True)
class Trajectory:
    """States at the integration's nodes.

    Attributes
    ----------
    time_s : array (n,)
    pose : array (n, 3)
        Centre of mass x, y (m) and mean heading (rad, unwrapped).
    velocity : array (n, 3)
        Velocity of the centre of mass in the robot's frame (m/s) and yaw momentum (model's own).
    work_j : array (n,)
        Friction work since the start.
    kappa, dkappa : array (n, N-1)
        Curvatures (1/m) of the body and their rates.
    no_load, no_load_rate : array (n, N-1)
        Curvatures that the actuators would give without load, and their rates; the body's own in the models
        that prescribe them.
    final : array
        The whole last state, to go on from.
    error_m_s : array (n-1,)
        Estimated local error of the speed, per step.
    """

    time_s: np.ndarray
    pose: np.ndarray
    velocity: np.ndarray
    work_j: np.ndarray
    kappa: np.ndarray
    dkappa: np.ndarray
    no_load: np.ndarray
    no_load_rate: np.ndarray
    final: np.ndarray
    error_m_s: np.ndarray

    def at(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pose (m, 3) and curvature (m, N-1) at other times, by cubic interpolation."""
        from scipy.interpolate import PchipInterpolator

        with np.errstate(over="ignore"):  # its harmonic means of slopes near zero, which come out as zero
            pose = PchipInterpolator(self.time_s, self.pose, axis=0)(time_s)
            kappa = PchipInterpolator(self.time_s, self.kappa, axis=0)(time_s)
        return pose, kappa

    def then(self, later: Trajectory) -> Trajectory:
        """Return this motion and the one that goes on from its final state as one."""
        joined = {
            f.name: np.concatenate([getattr(self, f.name), getattr(later, f.name)[1:]]) for f in fields(self)
        }
        joined["time_s"][self.time_s.size :] += self.time_s[-1]
        joined |= {"final": later.final, "error_m_s": np.concatenate([self.error_m_s, later.error_m_s])}
        return Trajectory(**joined)


class Integrator:
    """Runs one robot's model; holds the compiled step and nothing that changes."""

    def __init__(self, robot: Robot, model: str | None = None, *, room: bool = True) -> None:
        self.robot = robot
        self.structure = Structure.of(robot, model, room=room)
        self.parameters, self.mechanics, self.actuator = build(self.structure)
        self.layout = state_layout(self.structure)
        self.states = self.layout.size
        self.kernel = step_kernel(self.structure)
        self._room = room

    def pack(self, pressure_kpa: float, frequency_hz: float) -> np.ndarray:
        """Return the model's parameter vector."""
        return self.parameters.pack(self.robot, pressure_kpa, frequency_hz)

    def rest(self, x_m: float = 0.0, y_m: float = 0.0, heading_rad: float = 0.0) -> np.ndarray:
        """Return the state of the straight robot at rest, its centre of mass at (x, y)."""
        state = np.zeros(self.states)
        state[POSE] = x_m, y_m, heading_rad
        return state

    def check_played_once(self) -> None:
        """Raise InputError if an effect goes by a gait's frequency: valves played once have none."""
        if self.actuator.by_frequency:
            raise InputError(
                f"robot '{self.robot.name}': effect '{self.actuator.by_frequency[0]}' goes by a gait's "
                "frequency, which valves that are played once do not have: leave it out, and give "
                "curvature_per_pressure_1_m_kpa as it is while they are played"
            )

    def adopt(self, state: np.ndarray, source: Integrator) -> np.ndarray:
        """Return the state (nx,) of this model that a state of another model of the same snake stands for.

        As `StateLayout.adopt`; the yaw rate stays, so that the yaw momentum becomes this model's own.
        """
        adopted = self.layout.adopt(state, source.layout)
        inertia, of_shape = self._yaw_momenta(adopted)
        given, of_given_shape = source._yaw_momenta(state)
        if (inertia, of_shape) != (given, of_given_shape):  # alike ones keep every bit
            yaw_rate = (state[YAW_MOMENTUM] - of_given_shape) / given
            adopted[YAW_MOMENTUM] = inertia * yaw_rate + of_shape
        return adopted

    def _yaw_momenta(self, state: np.ndarray) -> tuple[float, float]:
        # neither depends on pressure and frequency
        inertia, of_shape = yaw_momenta(self.structure)(state, self.pack(1.0, 1.0))
        return float(inertia), float(of_shape)

    def steps(
        self, x: np.ndarray, mesh: Mesh, valve: np.ndarray, p: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Integrate over `mesh` with `valve` (N-1, phases): states (nx, n) after each step, errors (n,).

        Raises
        ------
        NoAnswerError
            If the state becomes non-finite.
        """
        return run_one(self.stepping(x, mesh, valve, p))

    def integrate(self, timeline: Timeline, x: np.ndarray, tolerance: float | None = None) -> Trajectory:
        """Integrate over a whole timeline from state `x` (the robot's valve delay is applied here).

        Raises
        ------
        NoAnswerError
            If the state becomes non-finite.
        """
        return run_one(self.travel(timeline, x, tolerance))

    def travel(
        self,
        timeline: Timeline,
        x: np.ndarray,
        tolerance: float | None = None,
        like: Trajectory | None = None,
    ) -> Search[Trajectory]:
        """Do what `integrate` does, as a search: see `run_batched` for many at once.

        The errors of a motion `like` this one, of the same duration, tell where steps have to be short from
        the first attempt on; what is asked of them is the same without it.
        """
        tolerance = INTEGRATION.tolerance_m_s if tolerance is None else tolerance
        timeline = timeline.delayed(valve_delay_s(self.robot))
        times, states, errors = [np.zeros(1)], [x[:, None]], []
        start = 0.0
        # a gait's cycles are alike: each begins with the mesh that served the one before
        known: dict[bytes, Mesh] = {}
        for piece, key, repeats in _runs_of_alike(self.pieces(timeline)):
            p = self.pack(float(piece.pressure_kpa[0]), float(piece.frequency_hz[0]))
            mesh = known.get(key) or self._first_mesh(piece.duration_s, start, tolerance, like)
            done = 1
            while repeats:  # twice as many at a time while the mesh serves
                many = min(repeats, 2 * done, INTEGRATION.most_alike)
                request = StepRequest(self.kernel, x, mesh, piece.valve, p)
                try:
                    got = yield from adapted(request, tolerance, pieces=many)
                except NonFiniteMotionError as error:
                    raise self._non_finite(error) from None
                mesh, done = got.mesh, got.pieces
                repeats -= done
                x = got.states[:, -1]
                times.append(start + np.cumsum(np.tile(mesh.h_s, done)))
                start = float(times[-1][-1])
                states.append(got.states)
                errors.append(got.error_m_s)
            known[key] = mesh
        return _trajectory(
            np.concatenate(times),
            np.concatenate(states, axis=1),
            np.concatenate(errors),
            self.layout,
        )

    @staticmethod
    def _first_mesh(durations: np.ndarray, begin_s: float, tolerance: float, like: Trajectory | None) -> Mesh:
        """Return the first guess of the steps of a piece that begins at a time."""
        if like is None:
            return Mesh.uniform(durations, INTEGRATION.first_step_s)
        first, last = np.searchsorted(like.time_s, [begin_s + 1e-9, begin_s + durations.sum() - 1e-9])
        window = slice(max(int(first) - 1, 0), int(last))
        nodes = like.time_s[window.start : window.stop + 1].copy()
        # the piece's own ends, where the other motion need not have a node
        nodes[0], nodes[-1] = begin_s, begin_s + durations.sum()
        return Mesh.graded(durations, np.diff(nodes), like.error_m_s[window], tolerance)

    def pieces(self, timeline: Timeline) -> list[Timeline]:
        """Cut a timeline into pieces of one pressure and frequency, a cycle each at most, to be integrated.

        Linear actuators know pressure only times the valve's state, so that a cycle whose pressure changes
        is one piece all the same.
        """
        if not self.actuator.linear:
            return _pieces(timeline, timeline.pressure_kpa)
        alike = np.zeros(timeline.duration_s.size)
        return [piece.at_one_pressure() for piece in _pieces(timeline, alike)]

    def stepping(
        self, x: np.ndarray, mesh: Mesh, valve: np.ndarray, p: np.ndarray
    ) -> Search[tuple[np.ndarray, np.ndarray]]:
        """Do what `steps` does, as a search: see `run_batched` for many at once."""
        try:
            return (yield from finite_steps(StepRequest(self.kernel, x, mesh, valve, p)))
        except NonFiniteMotionError as error:
            raise self._non_finite(error) from None

    def _non_finite(self, error: NonFiniteMotionError) -> NoAnswerError:
        return NoAnswerError(
            f"the simulated motion of robot '{self.robot.name}' becomes non-finite {error.time_s:.3g} s "
            "into a cycle: check pressure, masses, time constants and effect sizes"
        )


def _runs_of_alike(pieces: list[Timeline]) -> list[tuple[Timeline, bytes, int]]:
    """Return pieces with a key that says what they are and how often they follow each other."""
    runs: list[tuple[Timeline, bytes, int]] = []
    for piece in pieces:
        setting = np.array([piece.pressure_kpa[0], piece.frequency_hz[0]])
        # to a nanosecond: cycles cut from a long timeline differ by rounding
        key = np.round(piece.duration_s, 9).tobytes() + piece.valve.tobytes() + setting.tobytes()
        if runs and runs[-1][1] == key:
            runs[-1] = (runs[-1][0], key, runs[-1][2] + 1)
        else:
            runs.append((piece, key, 1))
    return runs


def _pieces(timeline: Timeline, pressure_kpa: np.ndarray) -> list[Timeline]:
    """Cut a timeline where pressure or frequency change, and at cycle ends, so that meshes can be reused."""
    longest_phases = INTEGRATION.longest_phases
    alike = (pressure_kpa == pressure_kpa[0]).all() and (
        timeline.frequency_hz == timeline.frequency_hz[0]
    ).all()
    short = timeline.duration_s.size <= longest_phases
    if alike and short and timeline.duration_s.sum() < 1 / timeline.frequency_hz[0] + 1e-9:
        return [timeline]
    pieces = []
    setting = list(zip(pressure_kpa.tolist(), timeline.frequency_hz.tolist()))
    start, elapsed, n = 0, 0.0, len(setting)
    for k, duration_s in enumerate(timeline.duration_s.tolist(), start=1):
        elapsed += duration_s
        changed = k < n and setting[k] != setting[start]
        # a cycle's durations may add up to a little less than its period
        full = elapsed >= 1 / setting[start][1] - 1e-9 or k - start >= longest_phases
        if k == n or changed or full:
            pieces.append(timeline.part(slice(start, k)))
            start, elapsed = k, 0.0
    return pieces


def _trajectory(
    time_s: np.ndarray, states: np.ndarray, errors: np.ndarray, layout: StateLayout
) -> Trajectory:
    actuators = states[layout.actuator]
    return Trajectory(
        time_s=time_s,
        pose=states[POSE].T,
        velocity=states[VELOCITY].T,
        work_j=states[WORK],
        kappa=states[layout.kappa].T,
        dkappa=states[layout.dkappa].T,
        no_load=actuators[: layout.segments].T,
        no_load_rate=actuators[layout.segments : 2 * layout.segments].T,
        final=states[:, -1],
        error_m_s=errors,
    )
