"""The JSON object and the words of a search's result."""

from __future__ import annotations

import math
from typing import Any

from srs_opt.gait import Gait, published_wave
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.score import transport_cost
from srs_opt.gait_opt.search import Found
from srs_opt.orbit.steady import steady_gait

_PRICES_TOLD = 4  # the dearest limits; the JSON has all
_NOTHING_BEYOND = 0.5  # % of speed that rounding and the search's tolerance explain


def wave_parameters(gait: Gait) -> tuple[list[float], list[float]] | None:
    """Return phase (rad, in [0, 2 pi)) and offset per segment; None unless one interval per segment."""
    if any(len(pairs) != 1 for pairs in gait.intervals):
        return None
    phases, offsets = [], []
    for ((on, off),) in gait.intervals:
        share = (off - on) % gait.period_s / gait.period_s
        angle = math.pi * (share - 0.5)
        phases.append((-angle - 2 * math.pi * on / gait.period_s) % (2 * math.pi))
        offsets.append(math.sin(angle))
    return phases, offsets


def switches(gait: Gait) -> list[dict[str, Any]]:
    """Return the on-intervals as the JSON lists them, segments from 1 (tail)."""
    return [
        {"segment": i, "on_s": on, "off_s": off}
        for i, pairs in enumerate(gait.intervals, start=1)
        for on, off in pairs
    ]


def baseline(problem: CycleProblem) -> dict[str, Any]:
    """Return the published gait's motion at the upper limits of frequency and pressure."""
    robot, limits = problem.robots[0], problem.limits
    frequency, pressure = limits.frequency_hz[1], limits.pressure_kpa[1]
    gait = published_wave(robot, frequency, pressure).gait()
    orbit = steady_gait(robot, gait, problem.model)
    return {
        "speed_m_s": orbit.speed_m_s,
        "turn_rate_rad_s": orbit.turn_rate_rad_s,
        "cost_of_transport": transport_cost(problem, gait, 0, orbit),
        "envelope_m": list(orbit.envelope_m),
        "frequency_hz": frequency,
        "pressure_kpa": pressure,
    }


def record(problem: CycleProblem, found: Found, solve_s: float, compile_s: float) -> dict[str, Any]:
    """Return the JSON object of the command."""
    gait, orbit = found.gait, found.orbits[0]
    wave = wave_parameters(gait)
    return {
        "objective": problem.goal.name,
        "speed_m_s": orbit.speed_m_s,
        "turn_rate_rad_s": orbit.turn_rate_rad_s,
        "radius_m": orbit.radius_m,
        "cost_of_transport": transport_cost(problem, gait, 0, orbit),
        "envelope_m": list(orbit.envelope_m),
        "frequency_hz": gait.frequency_hz,
        "pressure_kpa": gait.pressure_kpa,
        "phase_rad": None if wave is None else wave[0],
        "offset": None if wave is None else wave[1],
        "switches": switches(gait),
        "robots": [r.record() for r in found.certificate.robots],
        "worst_robot": found.certificate.worst_robot.name,
        "baseline": baseline(problem),
        "certificate": found.certificate.record(),
        "starts": len(found.merits),
        "merits": list(found.merits),
        "populations": found.populations,
        "limits": [price.record() for price in found.prices],
        "iterations": found.iterations,
        "interrupted": found.interrupted,
        "solve_s": solve_s,
        "compile_s": compile_s,
    }


def summary(answer: dict[str, Any]) -> str:
    """Return the result in words."""
    speed, radius = answer["speed_m_s"], answer["radius_m"]
    base = answer["baseline"]["speed_m_s"]
    way = "straight"
    if radius is not None:
        way = f"on a radius of {abs(radius):.3f} m to the {'left' if radius > 0 else 'right'}"
    right, left = answer["envelope_m"]
    certificate = answer["certificate"]
    lines = [
        f"{speed:.4f} m/s {way} at {answer['frequency_hz']:.3f} Hz and {answer['pressure_kpa']:.2f} kPa; "
        f"the published gait makes {base:.4f} m/s",
        f"  swept band {right:.4f} m to the right, {left:.4f} m to the left; "
        f"cost of transport {answer['cost_of_transport']:.2f}",
        f"  certificate: {'passed' if certificate['passed'] else 'FAILED'}; collocation off by "
        f"{100 * certificate['relative_error']:.2f} %, "
        f"gap after 50 cycles {certificate['periodicity_gap']:.1e}, "
        f"largest Floquet multiplier {certificate['largest_floquet_multiplier']:.2f}",
        *_others(certificate),
        *(f"  {price['words']}" for price in answer["limits"][:_PRICES_TOLD]),
        *_freed(answer.get("free")),
        *_scattered(answer),
        *_worst(answer),
    ]
    lines += [f"  {failure}" for failure in certificate["failures"]]
    if answer["interrupted"]:
        lines.append("  interrupted: this is the best gait found until then")
    return "\n".join(lines)


def _others(certificate: dict[str, Any]) -> list[str]:
    """Say that the speed depends on how the gait is begun, where it does."""
    speeds = ", ".join(f"{speed:.4f}" for speed in certificate["other_orbits_m_s"])
    return [f"  from rest; begun while rolling this gait can also run at {speeds} m/s"] if speeds else []


def _worst(answer: dict[str, Any]) -> list[str]:
    """Say which of several robots serves the goal worst, and how."""
    robots = answer["robots"]
    if len(robots) < 2:
        return []
    worst = next(r for r in robots if r["name"] == answer["worst_robot"])
    radius = "straight" if worst["radius_m"] is None else f"radius {worst['radius_m']:+.3f} m"
    return [
        f"  worst of {len(robots)} robots: '{worst['name']}', {worst['speed_m_s']:.4f} m/s, {radius}, "
        f"band {worst['band_m']:.4f} m"
    ]


def _scattered(answer: dict[str, Any]) -> list[str]:
    """Say that the landscape is rugged, where populations had to go on from the starts."""
    count, merits = answer["populations"], answer["merits"]
    if not count:
        return []
    begun, gained = merits[:-count], merits[-count:]
    words = (
        f"{count} populations of simulated gaits come to merits from {min(gained):.4f} to {max(gained):.4f}"
    )
    if begun:
        words += f", {len(begun)} starts from {min(begun):.4f} to {max(begun):.4f}"
    return [f"  many optima: {words}"]


def _freed(free: dict[str, Any] | None) -> list[str]:
    """Say what more than one on-interval per cycle buys, and what of it a higher frequency buys too."""
    if free is None or len(free["repeated_waves"]) < 2:
        return []
    fastest = max(free["repeated_waves"], key=lambda wave: wave["speed_m_s"])
    beyond = 100 * free["gain_beyond_frequency"]
    line = (
        f"  {100 * free['gain']:+.1f} % against one on-interval per cycle; the wave at "
        f"{fastest['frequency_hz']:.2f} Hz, {fastest['repeats']} times per cycle, makes "
        f"{fastest['speed_m_s']:.4f} m/s: "
    )
    if beyond < _NOTHING_BEYOND:
        return [line + "more intervals buy nothing beyond a higher limit on the frequency"]
    return [line + f"beyond a higher limit on the frequency, more intervals buy {beyond:.1f} %"]
