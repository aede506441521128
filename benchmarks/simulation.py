"""Simulated seconds per second: this package, a plain C loop, SciPy, CVODES; straight and turning."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from benchmarks.rivals import c_loop, cvodes_rival, drive, last_cycle, scipy_rival
from benchmarks.section import Section, best_time
from srs_opt.gait import Wave
from srs_opt.robot import wpi_srs
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.timeline import Timeline

LAG = math.pi / 2
WANTED = 1e-3  # relative error of the motion per cycle
LADDER = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
PAPER_S = 94.0  # 500 s of the complex model, MATLAB, 2015 (paper, section 4.2)


def run(quick: bool) -> Section:
    rows: list[list[str]] = []
    ratios: dict[str, float] = {}
    for label, offset in (("straight", 0.0), ("turning", 0.4)):
        wave = Wave.uniform(4, 2.0, 55.0, LAG, offset)
        ours, floor, reference = _ours(rows, label, wave, 20.0 if quick else 500.0, quick)
        ratios[f"{label}, time over C loop"] = ours / floor
        if not quick:
            _rivals(rows, label, wave, reference, ours / 500.0)
    notes = [
        "All integrate every period from rest. Errors: motion over the last cycle against a converged run "
        "(tolerance 1e-9 m/s). The rivals restart at every switch, SciPy with compiled right-hand side (and "
        f"Jacobian), CVODES as CasADi runs it, at the loosest tolerance of "
        f"{', '.join(f'{x:g}' for x in LADDER)} that reaches {WANTED:.1%}. Processor times.",
        f"The paper reports {PAPER_S:.0f} s for 500 s of the complex model.",
    ]
    columns = ["gait", "method", "s per 500 s", "over ours", "error of chord", "error of turn"]
    return Section("Simulation: 500 s of undulation", columns, rows, notes, ratios)


def _ours(
    rows: list[list[str]], label: str, wave: Wave, duration: float, quick: bool
) -> tuple[float, float, np.ndarray]:
    robot, gait = wpi_srs(), wave.gait()
    run = Integrator(robot)
    timeline, rest = Timeline.of_gait(gait, duration), run.rest()
    tight = Timeline.of_gait(gait, min(duration, 20.0))
    reference = _motion(run, tight, gait.period_s, 1e-9)
    tries = 5 if quick else 3
    floor, floor_motion = min((c_loop(wave, LAG, duration, 5e-4) for _ in range(tries)), key=lambda r: r[0])
    ours = best_time(lambda: run.integrate(timeline, rest), tries)
    again = min(c_loop(wave, LAG, duration, 5e-4)[0] for _ in range(tries))
    floor = min(floor, again)
    for name, seconds, motion in (("this package", ours, _motion(run, tight, gait.period_s)),
                                  ("C loop, RK4 at 0.5 ms", floor, floor_motion)):  # fmt: skip
        _row(rows, label, name, seconds / duration, ours / duration, motion, reference)
    return ours, floor, reference


def _motion(
    run: Integrator, timeline: Timeline, period_s: float, tolerance: float | None = None
) -> np.ndarray:
    path = run.integrate(timeline, run.rest(), *([] if tolerance is None else [tolerance]))
    first = int(np.argmin(abs(path.time_s - (path.time_s[-1] - period_s))))
    return last_cycle(path.pose[first], path.pose[-1])


def _rivals(rows: list[list[str]], label: str, wave: Wave, reference: np.ndarray, ours_per_s: float) -> None:
    robot, gait = wpi_srs(), wave.gait()
    p = Integrator(robot).pack(gait.pressure_kpa, gait.frequency_hz)
    makers: dict[str, Callable[[float], Callable]] = {
        "CVODES (CasADi)": lambda tolerance: cvodes_rival(robot, p, tolerance),
        "solve_ivp LSODA": lambda tolerance: scipy_rival(robot, p, "LSODA", tolerance),
        "solve_ivp Radau": lambda tolerance: scipy_rival(robot, p, "Radau", tolerance),
    }
    settled, cycles = 40, 4
    for name, make in makers.items():
        for tolerance in LADDER:
            rival = make(tolerance)
            motion = drive(rival, gait, settled if "Radau" not in name else 12)
            if _errors(motion, reference).max() <= WANTED:
                break
        seconds = best_time(lambda: drive(rival, gait, cycles), 2)  # noqa: B023
        _row(
            rows,
            label,
            f"{name} at {tolerance:g}",
            seconds / (cycles * gait.period_s),
            ours_per_s,
            motion,
            reference,
        )


def _errors(motion: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Relative errors of chord and turn; a straight gait's turn counts against a tenth of a radian."""
    return abs(motion - reference) / np.array([reference[0], max(abs(reference[1]), 0.1)])


def _row(
    rows: list[list[str]],
    label: str,
    name: str,
    per_s: float,
    ours: float,
    motion: np.ndarray,
    reference: np.ndarray,
) -> None:
    errors = _errors(motion, reference)
    rows.append(
        [label, name, f"{500 * per_s:.3g}", f"{per_s / ours:.2f}", f"{errors[0]:.1e}", f"{errors[1]:.1e}"]
    )
