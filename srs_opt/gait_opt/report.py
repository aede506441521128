"""The JSON object and the words of a search's result."""

from __future__ import annotations

import math
from typing import Any

from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.goal import Limits
from srs_opt.gait_opt.robust import published_orbit
from srs_opt.gait_opt.score import transport_cost
from srs_opt.gait_opt.search import Found
from srs_opt.gait_opt.settings import REPORT, STIFFNESS
from srs_opt.gait_opt.softness import robust_beside, speeds_at_stiffness
from srs_opt.gait_opt.table import GaitTable
from srs_opt.robot import Robot

_PRICES_TOLD = 4  # the costliest limits; the JSON has all


def wave_parameters(gait: Gait) -> tuple[list[float], list[float]] | None:
    """Return phase (rad, in [0, 2 pi)) and offset per segment; None unless one interval per segment."""
    if any(len(pairs) != 1 for pairs in gait.intervals):
        return None
    phases, offsets = [], []
    for ((on, off),) in gait.intervals:
        share = (off - on) % gait.period_s / gait.period_s
        # (13) inverted: duty 1/2 + asin(phi)/pi, on at omega t = -asin(phi) - beta
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
    orbit = published_orbit(problem, problem.robots[0])
    return {
        "speed_m_s": orbit.speed_m_s,
        "turn_rate_rad_s": orbit.turn_rate_rad_s,
        "cost_of_transport": transport_cost(problem, orbit.gait, 0, orbit),
        "envelope_m": list(orbit.envelope_m),
        "frequency_hz": orbit.gait.frequency_hz,
        "pressure_kpa": orbit.gait.pressure_kpa,
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
        "robots": _robots(problem, found),
        "worst_robot": found.certificate.worst_robot.name,
        **soft_speeds(problem.robots[0], gait, problem.limits if problem.goal.only_fast else None),
        "baseline": baseline(problem),
        "certificate": found.certificate.record(),
        "starts": len(found.merits),
        "merits": list(found.merits),
        "populations": found.populations,
        "limits": [price.record() for price in found.prices],
        "iterations": found.iterations,
        "from_rest": None if found.from_rest is None else found.from_rest.record(),
        "interrupted": found.interrupted,
        "solve_s": solve_s,
        "compile_s": compile_s,
    }


def _robots(problem: CycleProblem, found: Found) -> list[dict[str, Any]]:
    """Return what the certificate says of every robot, with its published gait's speed beside it."""
    return [
        {**own.record(), "published_m_s": published_orbit(problem, robot).speed_m_s}
        for robot, own in zip(problem.robots, found.certificate.robots)
    ]


def soft_speeds(robot: Robot, gait: Gait, beside: Limits | None) -> dict[str, Any]:
    """Return the speeds that a rigid robot's gait would have if its segments had a stiffness.

    Those of the robust gait inside the limits `beside` are there too, if these are given and the robot has as
    many segments; all are empty for robots that have a stiffness.
    """
    other = None if beside is None else robust_beside(robot, beside)
    gaits = [gait] if other is None else [gait, other]
    own, *robust = speeds_at_stiffness(robot, gaits)

    def listed(speeds: list[float | None]) -> list[dict[str, float | None]]:
        return [{"ei_n_m2": ei, "speed_m_s": speed} for ei, speed in zip(STIFFNESS.silicone_n_m2, speeds)]

    return {
        "speed_at_stiffness": listed(own),
        "robust_speed_at_stiffness": [entry for speeds in robust for entry in listed(speeds)],
    }


def table_record(robot: Robot, table: GaitTable, limits: Limits, solve_s: float) -> dict[str, Any]:
    """Return the JSON object of a table's making."""
    fastest = max(table.gaits, key=lambda g: g.speed_m_s)
    radii = [abs(g.radius_m) for g in table.gaits if g.radius_m is not None]
    return {
        "objective": "table",
        "gaits": len(table.gaits),
        "speed_max_m_s": fastest.speed_m_s,
        **soft_speeds(robot, fastest.gait, limits),
        "radius_min_m": min(radii, default=None),
        "band_min_m": min(sum(g.envelope_m) for g in table.gaits),
        "solve_s": solve_s,
    }


def robust_words(table: GaitTable, robots: tuple[Robot, ...]) -> str:
    """Return what a table for several robots says of itself."""
    first = table.gaits[0]
    return (
        f", chosen for {len(robots)} robots, not optimized: the first, '{first.name}', makes at least "
        f"{first.worst_speed_m_s:.3f} m/s on each; motions are those of '{robots[0].name}'"
    )


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
        *_each_robot(answer),
        *_from_rest(answer),
        *if_soft(answer),
        *_judged(certificate),
    ]
    lines += [f"  {failure}" for failure in certificate["failures"]]
    if answer["interrupted"]:
        lines.append("  interrupted: this is the best gait found until then")
    return "\n".join(lines)


def _others(certificate: dict[str, Any]) -> list[str]:
    """Say that the speed depends on how the gait is begun, where it does."""
    speeds = ", ".join(f"{speed:.4f}" for speed in certificate["other_orbits_m_s"])
    return [f"  from rest; begun while rolling this gait can also run at {speeds} m/s"] if speeds else []


def _each_robot(answer: dict[str, Any]) -> list[str]:
    """Say what several robots make of the gait, the worst marked."""
    if len(answer["robots"]) == 1:
        return []
    return [
        f"  {r['name']}: {r['speed_m_s']:.4f} m/s, {r['speed_m_s'] / r['published_m_s']:.2f} times the "
        f"published gait{' (the worst)' if r['name'] == answer['worst_robot'] else ''}"
        for r in answer["robots"]
    ]


def _from_rest(answer: dict[str, Any]) -> list[str]:
    """Say that derivatives did not find the gait alone, where a search by simulation followed them."""
    search = answer["from_rest"]
    if search is None:
        return []
    before, after = search["merit_before"], search["merit_after"]
    return [
        "  collocation led to orbits that a standing start does not reach; "
        f"{search['evaluations']} gaits simulated from rest (CMA-ES): merit {before:.4f} to {after:.4f}"
    ]


def if_soft(answer: dict[str, Any], gait: str = "this gait") -> list[str]:
    """Say what a rigid robot's gait, and the robust gait, would make if the segments yielded."""

    def words(entries: list[dict[str, Any]]) -> str:
        return ", ".join(
            "no steady motion" if e["speed_m_s"] is None else f"{e['speed_m_s']:.3f}" for e in entries
        )

    own, robust = answer["speed_at_stiffness"], answer["robust_speed_at_stiffness"]
    if not own:
        return []
    stiffnesses = ", ".join(f"{e['ei_n_m2']:g}" for e in own)
    lines = [f"  rigid actuators assumed: at {stiffnesses} N m^2 {gait} makes {words(own)} m/s"]
    if robust:
        lines += [
            f"  the robust gait {words(robust)} m/s: for segments of unknown stiffness (--stiffness EI...)"
        ]
    return lines


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
    if beyond < REPORT.least_gain_percent:
        return [line + "more intervals buy nothing beyond a higher limit on the frequency"]
    return [line + f"beyond a higher limit on the frequency, more intervals buy {beyond:.1f} %"]


def _judged(certificate: dict[str, Any]) -> list[str]:
    """Return what the other engine says, where it was asked."""
    lines = []
    for opinion in certificate.get("judge", ()):
        them, error = opinion["judge"], opinion["judge"]["error"]["speed_m_s"]
        word = "agrees" if opinion["agrees"] else "DISAGREES"
        lines.append(
            f"  judge: {word} about robot '{opinion['name']}': {them['speed_m_s']:.4f} ± {error:.4f} m/s, "
            f"{them['turn_rate_rad_s']:+.3f} rad/s in the other engine"
        )
    return lines
