"""Is there a robot that satisfies all statements of the paper's experiments at once?

    python -m benchmarks.paper_statements --sets 300 --jobs 2

The paper prints neither L_o, the time constants, C0 over pressure, the friction law nor a stiffness, and we
have no measured value. So robots are drawn within wide bounds; a soft one stands for the measured robot, and
the paper's two models predict it with the same parameters, C0 as a lifted or a grounded segment shows it, the
gap in the geometry or in the factor (l + L_o)/l. 1 and 2 Hz, 41 and 55 kPa, offsets 0 and 0.4.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np

from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser
from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait, published_wave
from srs_opt.orbit.steady import steady_gaits
from srs_opt.robot import Robot, wpi_srs

Row = dict[str, Any]
FREQUENCIES_HZ, PRESSURES_KPA, OFFSETS = (1.0, 2.0), (41.0, 55.0), (0.0, 0.4)
GROUND_LOSS_N_M = 0.0099  # bend lost on the ground times EI, at mu_n = 0.57
MAXIMUM_M_S = (0.20, 0.24)  # "around 220 mm/s"
STATEMENTS = {
    "maximum": "the fastest straight gait makes about 0.22 m/s",
    "straight": "straight speeds: both models near the measured, complex nearer",
    "turning": "speeds at offset 0.4: simplified nearer",
    "radius": "radii at offset 0.4: measured above both models, complex nearer",
    "pressure": "radii fall with pressure",
}
NEAR = 0.25  # mean relative distance that still counts as similar


def drawn(number: int, seed: int) -> tuple[Robot, Robot, float]:
    """Return a soft robot, what the paper's models take it for, and the factor on their speeds and radii."""
    rng = np.random.default_rng([seed, number])

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    gap = float(rng.uniform(0.004, 0.024))
    slope, law = log(0.15, 0.7), str(rng.choice(["per_axis", "cone"]))
    slow, fast = log(0.03, 0.2), float(rng.uniform(0.2, 1.0))
    chamber = None if rng.random() < 0.25 else log(0.002, 0.03)
    spring = None if rng.random() < 0.5 else log(0.0006, 0.02)
    common = {
        "gap_length_m": gap, "friction_law": law, "tau1_s": slow, "tau2_s": slow * fast,
        "curvature_per_pressure_1_m_kpa": slope,
    }  # fmt: skip
    rigid = wpi_srs().with_values(**common)
    real = rigid.with_values(bending_stiffness_n_m2=chamber, gap_stiffness_n_m2=spring)
    flexibility = (1 / chamber if chamber else 0) + (gap / 0.037 / spring if spring else 0)
    if rng.random() < 0.5:  # C0 as the step on the ground shows it
        known = slope - GROUND_LOSS_N_M * flexibility / 48
        rigid = rigid.with_values(curvature_per_pressure_1_m_kpa=max(known, 0.2 * slope))
    factor = 1.0
    if rng.random() < 0.5:
        factor = (0.037 + gap) / 0.037
        rigid = rigid.with_values(gap_length_m=0.0)
    return real, rigid, factor


def motions(robot: Robot, model: str, factor: float = 1.0) -> np.ndarray:
    """Return speeds (m/s) and radii (m) over offset, frequency, pressure: (2, 2, 2, 2)."""
    gaits: list[Gait] = [
        published_wave(robot, f, p, o).gait() for o in OFFSETS for f in FREQUENCIES_HZ for p in PRESSURES_KPA
    ]
    found = np.full((2, len(gaits)), np.nan)
    for k, orbit in enumerate(steady_gaits(robot, gaits, model)):
        if not isinstance(orbit, NoAnswerError):
            radius = orbit.radius_m
            found[:, k] = abs(orbit.speed_m_s), np.nan if radius is None else abs(radius)
    return factor * found.reshape(2, 2, 2, 2)


def examine(number: int, seed: int) -> Row:
    """Return one robot's parameters and which statements hold."""
    real, rigid, factor = drawn(number, seed)
    measured = motions(real, real.own_model)
    complex_, simplified = (motions(rigid, m, factor) for m in ("complex", "simplified"))
    keys = (
        "gap_length_m", "friction_law", "curvature_per_pressure_1_m_kpa", "tau1_s", "tau2_s",
        "bending_stiffness_n_m2", "gap_stiffness_n_m2",
    )  # fmt: skip
    row: Row = {key: getattr(real, key) for key in keys}
    row |= {"known_c0": rigid.curvature_per_pressure_1_m_kpa, "factor": round(factor, 3)}
    held = statements(measured, complex_, simplified)
    numbers = {"measured": measured, "complex": complex_, "simplified": simplified}
    return row | held | {n: _listed(v) for n, v in numbers.items()}


def _listed(values: np.ndarray) -> list[float | None]:
    """Return speeds and radii for JSON; straight gaits have no radius."""
    return [None if np.isnan(v) else round(float(v), 4) for v in values.ravel()]


def statements(measured: np.ndarray, complex_: np.ndarray, simplified: np.ndarray) -> Mapping[str, bool]:
    """Return which statements hold; a motion that was not found holds none of them."""

    def off(model: np.ndarray, offset: int) -> float:
        return float(np.mean(np.abs(model[0, offset] / measured[0, offset] - 1)))

    radii = [v[1, 1].mean() for v in (measured, complex_, simplified)]
    falls = all(np.all(v[1, 1, :, 0] > v[1, 1, :, 1]) for v in (measured, complex_, simplified))
    return {
        "maximum": bool(MAXIMUM_M_S[0] <= measured[0, 0].max() <= MAXIMUM_M_S[1]),
        "straight": off(complex_, 0) < off(simplified, 0) < NEAR,
        "turning": off(simplified, 1) < off(complex_, 1) < 2 * NEAR,
        "radius": bool(radii[0] > radii[1] > radii[2]),
        "pressure": bool(falls),
    }


def run(quick: bool) -> Section:
    """Show the stored study."""
    found = stored_rows("paper_statements")
    title = "The paper's statements: which go together"
    if found is None:
        return Section(title, ["statement"], [], ["Not made yet."])
    when, rows = found
    names = list(STATEMENTS)
    table = [
        [STATEMENTS[a], *(str(sum(r[a] and r[b] for r in rows)) for b in names)] for a in names
    ]  # fmt: skip
    together = sum(all(r[n] for n in names) for r in rows)
    notes = [f"{len(rows)} robots ({when}); all five hold for {together}."]
    for left in names:
        count = sum(all(r[n] for n in names if n != left) for r in rows)
        notes.append(f"Without '{left}': {count}.")
    never = [f"{a} and {b}" for a, b in combinations(names, 2) if not any(r[a] and r[b] for r in rows)]
    notes.append("Never together: " + ("; ".join(never) or "no pair") + ".")
    return Section(title, ["holds with", *names], table, notes)


def main(argv: list[str] | None = None) -> int:
    """Run the study and print its table."""
    options = study_parser("paper_statements", __doc__, 300).parse_args(argv)
    gather("paper_statements", examine, [(k, options.seed) for k in range(options.sets)], options)
    print(run(quick=False).markdown())
    return 0


if __name__ == "__main__":
    sys.exit(main())
