"""A plan checked from its motion.json alone: what the valves do, and where the laboratory's robot goes.

The laboratory shares no code with the planner: Kane's equations, explicit Runge-Kutta, its own body outline.
"""

import dataclasses
import json
import math

import numpy as np
import pytest
import shapely
import yaml

from planners.plan.__main__ import main
from virtual_lab.assemble import assemble
from virtual_lab.simulate import look, sample
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth

MAZES = ("first", "narrow", "blocks", "slalom", "u_turn", "rooms")


def state_at(pairs, time_s):
    """S of one segment by its on-intervals."""
    return 1 if any(a <= time_s < b if a < b else (time_s >= a or time_s < b) for a, b in pairs) else -1


def valves_of(motion, run):
    """Phases of a run: edges (n + 1), states (n, N-1), and the pressure as (times, kPa), linear between."""
    edges, states, times, pressures = [], [], [], []

    def phase(begin, row):
        edges.append(begin)
        states.append(row)

    cycles = [("cycle", c[1], c) for c in run["cycles"]] + [
        ("halt", h["start_s"], h) for h in run.get("halts", [])
    ]
    for kind, start, what in sorted(cycles, key=lambda entry: entry[1]):
        if kind == "halt":
            at = start
            for duration, *row in zip(what["duration_s"], *what["valve"]):
                phase(at, row)
                at += duration
            last_s = at
            continue
        plain = what[2] is None
        entry = motion["gaits"][what[0]] if plain else motion["joining"][what[2]]
        switches = sorted({0.0, *(t for pairs in entry["intervals"] for pair in pairs for t in pair)})
        for t, following in zip(switches, [*switches[1:], entry["period_s"]]):
            middle = (t + following) / 2
            phase(start + t, [state_at(pairs, middle) for pairs in entry["intervals"]])
        ramp_s = 0.0 if plain else entry["ramp_s"]
        begin_kpa = entry["pressure_kpa"] if plain else entry["from_kpa"]
        times += [start, start + max(ramp_s, 1e-9), start + entry["period_s"] - 1e-9]
        pressures += [begin_kpa, entry["pressure_kpa"], entry["pressure_kpa"]]
        last_s = start + entry["period_s"]
    edges.append(last_s)
    return np.array(edges), np.array(states), np.array(times), np.array(pressures)


def violations(motion, run):
    """Count holds below the dwell, switches off the tick and jumps of pressure."""
    limits = motion["valves"]
    edges, states, times, pressures = valves_of(motion, run)
    found = {"dwell": 0, "tick": 0, "pressure": 0}
    for column in states.T:
        changes = np.flatnonzero(np.diff(column)) + 1
        at = edges[np.concatenate([[0], changes])]  # the last hold ends after the record
        found["dwell"] += int((np.diff(at) < limits["min_dwell_s"] - 1e-6).sum())
        off = np.abs(at / limits["tick_s"] - np.round(at / limits["tick_s"]))
        found["tick"] += int((off > 1e-3).sum())
    steps_s, steps_kpa = np.diff(times), np.abs(np.diff(pressures))
    allowed_s = 0.1 if limits["pressure_rate_kpa_s"] is None else steps_kpa / limits["pressure_rate_kpa_s"]
    found["pressure"] = int(((steps_kpa > 1e-6) & (steps_s < allowed_s - 1e-6)).sum())
    return found


def lab_clearance(motion, maze, refine):
    """Least clearance of the laboratory's robot under the planned valves, from the walls of our maze file."""
    run = motion["runs"][0]
    edges, states, times, pressures = valves_of(motion, run)
    stairs = np.unique(np.concatenate([edges, *(np.arange(t, t + 0.1, 0.001) for t in edges)]))
    stairs = stairs[np.append(np.diff(stairs) > 1e-7, True)]
    middles = (stairs[:-1] + stairs[1:]) / 2
    row = np.searchsorted(edges, middles, side="right").clip(1, len(states)) - 1
    sign = states[row].astype(float)
    truth = Truth(friction_speed_m_s=0.002)
    tables = assemble(truth, Trial("plan", 1.0, 40.0), 1.0, refine=refine)
    longest = np.diff(tables.edges).max() / tables.steps[np.diff(tables.edges).argmax()]
    c0 = truth.parameters.curvature_per_pressure_1_m_kpa
    tables = dataclasses.replace(
        tables,
        edges=stairs,
        sign=sign,
        push=c0 * sign * np.interp(middles, times, pressures)[:, None],
        steps=np.maximum(np.ceil(np.diff(stairs) / longest), 1).astype(np.int64),
    )
    p, start = truth.parameters, maze["start"]
    half = (p.links - 1) * (p.segment_length_m + p.gap_length_m) / 2
    heading = start["heading"]
    tail = [start["x"] - half * math.cos(heading), start["y"] - half * math.sin(heading), heading]
    looks = np.arange(0.0, run["duration_s"], 0.004)
    samples = sample(tables, np.array([*tail, 0.0, 0.0, 0.0]), np.zeros((p.links - 1, 4)), looks)
    body = outline(look(tables, samples, looks), p)
    walls = [shapely.box(*wall["box"]) for wall in maze["walls"] if "box" in wall]
    walls += [shapely.LineString(w["segment"]).buffer(w["thickness"] / 2, cap_style="flat")
              for w in maze["walls"] if "segment" in w]  # fmt: skip
    walls += [shapely.Polygon(w["polygon"]) for w in maze["walls"] if "polygon" in w]
    walls += [shapely.Point(*w["disc"][:2]).buffer(w["disc"][2], 64) for w in maze["walls"] if "disc" in w]
    solid = shapely.union_all([*walls, shapely.box(*maze["bounds"]).exterior])
    return float(shapely.distance(shapely.linestrings(body), solid).min()) - motion["body_width_m"] / 2


def outline(seen, p):
    """Centre lines (T, points, 2): half gaps along the links, arcs of constant curvature between."""
    direction = np.stack([np.cos(seen.theta), np.sin(seen.theta)], axis=-1)
    place = np.stack([seen.x, seen.y], axis=-1)
    points = [place[:, 0]]
    for s in range(p.links - 1):
        here = place[:, s] + p.gap_length_m / 2 * direction[:, s]
        points.append(here)
        for u in np.linspace(0, 1, 7)[1:]:
            length, bend = u * p.segment_length_m, seen.kappa[:, s]
            chord = length * np.sinc(length * bend / 2 / np.pi)
            angle = seen.theta[:, s] + length * bend / 2
            points.append(here + chord[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1))
        points.append(place[:, s + 1])
    return np.stack(points, axis=1)


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """Return a function from a maze's name to its motion and plan, each planned once and driven."""
    known = {}

    def get(name):
        if name not in known:
            out = tmp_path_factory.mktemp(name)
            assert main([f"mazes/{name}.yaml", "--out", str(out), "--execute", "--quiet"]) == 0
            known[name] = [json.loads((out / f).read_text()) for f in ("motion.json", "plan.json")]
        return known[name]

    return get


@pytest.mark.parametrize("name", MAZES)
def test_valves_can_play_it(planned, name):
    motion, _ = planned(name)
    for run in motion["runs"]:
        assert violations(motion, run) == {"dwell": 0, "tick": 0, "pressure": 0}
    assert motion["joining"]  # or this would test nothing


@pytest.mark.parametrize("name", ["first", "narrow", "slalom"])
def test_the_laboratory_keeps_the_certified_clearance(planned, name):
    motion, plan = planned(name)
    with open(f"mazes/{name}.yaml", encoding="utf-8") as file:
        maze = yaml.safe_load(file)
    if "walls" not in maze:
        pytest.skip("a grid")
    clearance = lab_clearance(motion, maze, refine=2.0)
    assert clearance >= plan["clearance_m"] - 2e-6
    assert clearance < plan["clearance_m"] + 0.001 or clearance > 0.03
