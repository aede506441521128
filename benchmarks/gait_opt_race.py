"""The fastest straight gait by collocation, by CMA-ES and by single shooting, from the same starts."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from unittest.mock import patch

import numpy as np

from benchmarks.section import Section
from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait, Wave
from srs_opt.gait_opt.collocation import program as program_module
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.continuation import continuation_stages, run_stages
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.report import wave_parameters
from srs_opt.gait_opt.starts import starting_gaits
from srs_opt.orbit import steady
from srs_opt.orbit.body import integrator
from srs_opt.orbit.sensitivity import sensitivity
from srs_opt.orbit.steady import Orbit, steady_gait, steady_gaits
from srs_opt.robot import wpi_srs
from srs_opt.simulate.kernel import Course, Kernel

BEST_M_S = 0.557  # the fastest wave known at 1-2 Hz and 41-55 kPa
NEAR = 0.99
STRAIGHT_RAD_S = 0.02
TURN_COST = 0.5  # m/s per rad/s: what the collocation search's own score takes off
PATIENCE_S, QUICK_S = 120.0, 0.5  # processor time per method and start

ROBOT = wpi_srs()
PROBLEM = CycleProblem((ROBOT,), "complex", Goal("speed"), Limits())


class Reached(Exception):
    """A simulated gait is near enough to the best known."""


class TookTooLong(Exception):
    """Patience is over."""


@dataclass
class Watch:
    """What a method has spent, and the fastest straight gait that it has simulated.

    Attributes
    ----------
    periods : float
        Of the robot's motion, integrated (with derivatives or without).
    sweeps : int
        IPOPT's iterations: each evaluates the equations over a cycle's mesh, with derivatives.
    """

    patience_s: float = PATIENCE_S
    best_m_s: float = 0.0
    periods: float = 0.0
    sweeps: int = 0
    wall_s: float = field(default_factory=time.perf_counter)
    processor_s: float = field(default_factory=time.process_time)

    def saw(self, orbit: Orbit) -> None:
        if abs(orbit.turn_rate_rad_s) < STRAIGHT_RAD_S:
            self.best_m_s = max(self.best_m_s, orbit.speed_m_s)
        if self.best_m_s >= NEAR * BEST_M_S:
            raise Reached
        if time.process_time() - self.processor_s > self.patience_s:
            raise TookTooLong

    def stopped(self) -> None:
        self.wall_s = time.perf_counter() - self.wall_s
        self.processor_s = time.process_time() - self.processor_s


@contextmanager
def watched(patience_s: float = PATIENCE_S) -> Iterator[Watch]:
    """Count what is simulated inside; leave as soon as a gait at the robot's own friction is good enough."""
    watch = Watch(patience_s)
    own_search, own_run, own_solve = steady._search, Kernel.run, program_module.Program.solve
    frequency = integrator(ROBOT).parameters.names.index("frequency_hz")

    def search(run, gait, tolerance, guess):  # type: ignore[no-untyped-def]
        orbit = yield from own_search(run, gait, tolerance, guess)
        if run.robot == ROBOT:
            watch.saw(orbit)
        return orbit

    def integrate(self: Kernel, courses: Sequence[Course], *, keep: bool = True):  # type: ignore[no-untyped-def]
        watch.periods += sum(float(c.h_s.sum() * c.p[frequency]) for c in courses)
        return own_run(self, courses, keep=keep)

    def solve(self, *arguments, **named):  # type: ignore[no-untyped-def]
        solution = own_solve(self, *arguments, **named)
        watch.sweeps += solution.iterations
        return solution

    try:
        with (
            patch.object(steady, "_search", search),
            patch.object(Kernel, "run", integrate),
            patch.object(program_module.Program, "solve", solve),
        ):
            yield watch
    except (Reached, TookTooLong):
        pass
    watch.stopped()


def by_collocation(start: Gait, seed: int) -> None:
    """Run the continuation from the start, then from others, as the command does."""
    run_stages(PROBLEM, start, continuation_stages(ROBOT.friction_speed_m_s, quick=True))
    for other in starting_gaits(PROBLEM, 8, seed + 100):
        run_stages(PROBLEM, other, continuation_stages(ROBOT.friction_speed_m_s, quick=True))


LOW = np.array([1.0, 41.0, *[-math.pi] * 3, *[-0.9] * 4])
HIGH = np.array([2.0, 55.0, *[math.pi] * 3, *[0.9] * 4])


def wave_of(x: np.ndarray) -> Gait:
    """Return the wave of frequency, pressure, three lags and four offsets, each scaled to [0, 1]."""
    v = LOW[: x.size] + np.clip(x, 0, 1) * (HIGH - LOW)[: x.size]
    phases = np.concatenate([[0.0], np.cumsum(v[2:5])])
    offsets = v[5:] if v.size > 5 else np.zeros(4)
    return Wave(float(v[0]), float(v[1]), tuple(phases.tolist()), tuple(offsets.tolist())).gait()


def scaled(gait: Gait) -> np.ndarray:
    """Return the unknowns of a gait, see `wave_of`."""
    found = wave_parameters(gait)
    assert found is not None
    phases, offsets = found
    lags = (np.diff(phases) + math.pi) % (2 * math.pi) - math.pi
    values = np.array([gait.frequency_hz, gait.pressure_kpa, *lags, *offsets])
    return (values - LOW) / (HIGH - LOW)


def by_cma(start: Gait, seed: int, *, offsets: bool) -> None:
    """CMA-ES with restarts; a generation's gaits share the lanes of the compiled steady-gait solver."""
    import cma

    x = scaled(start) if offsets else scaled(start)[:5]
    for restart in range(100):
        options = {"bounds": [0.0, 1.0], "seed": 1000 * seed + restart + 1, "verbose": -9}
        strategy = cma.CMAEvolutionStrategy(x, 0.15, options)
        while not strategy.stop():
            asked = strategy.ask()
            strategy.tell(asked, [cost(o) for o in steady_gaits(ROBOT, [wave_of(a) for a in asked])])
        x = np.random.default_rng([seed, restart]).uniform(0.2, 0.8, x.size)


def cost(orbit: Orbit | NoAnswerError) -> float:
    """Return what CMA-ES makes small."""
    if isinstance(orbit, NoAnswerError):
        return 1.0
    return TURN_COST * abs(orbit.turn_rate_rad_s) - orbit.speed_m_s


def by_shooting(start: Gait, seed: int) -> None:
    """SLSQP on the simulated steady gait with the orbit's exact sensitivities, straight as a constraint."""
    from scipy.optimize import minimize

    cache: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def motion(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        key = np.asarray(x).tobytes()
        if key not in cache:
            cache[key] = _motion_and_slope(x)
        return cache[key]

    x = scaled(start)
    for restart in range(100):
        minimize(
            lambda x: -motion(x)[0][0],
            x,
            jac=lambda x: -motion(x)[1][0],
            bounds=[(0.0, 1.0)] * x.size,
            constraints={
                "type": "eq",
                "fun": lambda x: motion(x)[0][1],
                "jac": lambda x: motion(x)[1][1],
            },
            method="SLSQP",
            options={"maxiter": 200, "ftol": 1e-7},
        )
        x = scaled(starting_gaits(PROBLEM, 2, 1000 * seed + restart)[1])


def _motion_and_slope(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (speed, turn rate) and their derivatives (2, 9) by the scaled unknowns."""
    v = LOW + np.clip(x, 0, 1) * (HIGH - LOW)
    phases = np.concatenate([[0.0], np.cumsum(v[2:5])])
    wave = Wave(float(v[0]), float(v[1]), tuple(phases.tolist()), tuple(v[5:].tolist()))
    orbit = steady_gait(ROBOT, wave.gait())
    by = sensitivity(ROBOT, orbit).of_wave(wave)
    by_phase = by["phase_rad"]
    lags = [by_phase[k + 1 :].sum(axis=0) for k in range(3)]
    slope = np.stack([by["frequency_hz"], by["pressure_kpa"], *lags, *by["offset"]], axis=1)
    return np.array([orbit.speed_m_s, orbit.turn_rate_rad_s]), slope * (HIGH - LOW)


METHODS: dict[str, Callable[[Gait, int], None]] = {
    "collocation": by_collocation,
    "CMA-ES": lambda start, seed: by_cma(start, seed, offsets=True),
    "CMA-ES, offsets held at 0": lambda start, seed: by_cma(start, seed, offsets=False),
    "single shooting, exact slopes": by_shooting,
}
COLUMNS = ["", "reached", "wall s", "processor s", "periods simulated", "IPOPT iterations"]


def run(quick: bool) -> Section:
    seeds, patience_s = (range(1), QUICK_S) if quick else (range(8), PATIENCE_S)
    with watched():  # libraries load, kernels compile
        by_collocation(starting_gaits(PROBLEM, 1, 0)[0], 0)
    spent: dict[str, list[Watch]] = {name: [] for name in METHODS}
    for seed in seeds:
        start = starting_gaits(PROBLEM, 1, 0)[0] if seed == 0 else starting_gaits(PROBLEM, 2, seed)[1]
        for name, method in METHODS.items():
            with watched(patience_s) as watch:
                method(start, seed)
            spent[name].append(watch)
    rows = [_row(name, watches) for name, watches in spent.items()]
    ours, rival = spent["collocation"], spent["CMA-ES"]
    ratios = {
        "processor time over CMA-ES's": _sum(ours, "processor_s") / _sum(rival, "processor_s"),
        "periods over CMA-ES's": _sum(ours, "periods") / _sum(rival, "periods"),
    }
    notes = [
        f"Straight ahead, built-in robot, 1-2 Hz, 41-55 kPa, from the published gait and {len(seeds) - 1} "
        f"quasi-random waves, the same for all: until a simulated gait makes {NEAR:.0%} of {BEST_M_S} m/s. "
        "Medians over starts (smallest to largest). CMA-ES and shooting have this program's compiled "
        "steady-gait solver, CMA-ES four gaits at a time. Wall time includes whatever else the machine did.",
        "CMA-ES with the offsets held at 0 searches five unknowns instead of nine: it is told that the "
        "answer is a symmetric gait, which the others find out. Shooting knows no limits along the path "
        "(band, curvature) and no more than one interval per segment.",
    ]
    return Section("Fastest gait: a race", COLUMNS, rows, notes, ratios)


def _sum(watches: Sequence[Watch], what: str) -> float:
    return float(sum(getattr(w, what) for w in watches))


def _row(name: str, watches: Sequence[Watch]) -> list[str]:
    reached = sum(w.best_m_s >= NEAR * BEST_M_S for w in watches)
    cells = [name, f"{reached} of {len(watches)}"]
    for what, digits in (("wall_s", 2), ("processor_s", 2), ("periods", 0), ("sweeps", 0)):
        values = [float(getattr(w, what)) for w in watches]
        middle, low, high = np.median(values), min(values), max(values)
        cells.append(f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})")
    return cells
