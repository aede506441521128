"""Every failure that a user can meet: exit status 1 or 2, one line on stderr, no traceback."""

import importlib
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOT_COMMANDS = {"planners.tour"}

RUN = {
    "name": "planned", "duration_s": 1, "cycles": [[0, 0, None]], "centre": [[0, 0], [1, 0]],
    "body": [[0, 0, 1, 0], [1, 0, 2, 0]], "clearance_mm": [50, 50],
}  # fmt: skip
MOTION = {
    "version": 2, "robot": "x", "body_width_m": 0.04, "margin_m": 0.005, "runs": [RUN], "joining": [],
    "valves": {"min_dwell_s": 0.02, "tick_s": 0.001, "pressure_rate_kpa_s": None},
    "maze": {"name": "x", "bounds": [0, 0, 1, 1], "rings": [], "cells": None, "start": None, "goal": None},
    "gaits": [{"name": "x", "period_s": 1, "pressure_kpa": 50, "intervals": [[[0, 0.5]]]}],
}  # fmt: skip

# command, arguments, exit status, what the one line must say ({tmp} is a fresh folder with the files below)
FILES = {
    "typo.yaml": "lenght: 3\n",
    "negative.yaml": "link_mass_kg: -1\n",
    "text.yaml": "links: five\n",
    "twice.yaml": "links: 5\nlinks: 6\n",
    "effect.yaml": "effects: [{name: tether_drg, force_n: 0.1}]\n",
    "place.yaml": "effects: [{name: segment_bias, bias: 1, segment: 9}]\n",
    "broken.yaml": "links: [5\n",
    "cone.yaml": "friction_law: cone\n",
    "stribeck.yaml": "effects: [{name: stribeck, excess: 1, speed: 0.1}]\n",
    "droop.yaml": "effects: [{name: supply_droop, per_hz: 0.1}]\n",
    "latin.yaml": b"name: M\xfcller\n",
    "empty.csv": "",
    "map.csv": "a,b\n1,2\n",
    "gait.json": '{"frequency_hz": 2}',
    "table.json": '{"version": 1, "gaits": []}',
    "old_table.json": '{"version": 99, "gaits": []}',
    "motion.json": '{"version": 99}',
    "walls.yaml": "bounds: [0, 0, 2, 1]\nwalls: [{segmnt: [[0, 0], [1, 1]]}]\nstart: {x: 1, y: 0.5}\n",
    "in_wall.yaml": "bounds: [0, 0, 2, 1]\nwalls: [{box: [0.4, 0.3, 0.8, 0.7]}]\n"
    "start: {x: 0.5, y: 0.5}\ngoal: {x: 1.8, y: 0.5, radius: 0.05}\n",
    "no_goal.yaml": "bounds: [0, 0, 2, 1]\nstart: {x: 0.5, y: 0.5}\n",
    "ros.yaml": "image: gone.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n",
    "maze.txt": "o---o\n|   \n",
    "maze.map": "type octile\nheight 2\nwidth 2\nmap\n..\n",
    "maze.world": "<sdf><world></sdf>",
    "set/dataset.yaml": "name: x\nrobot: robot.yaml\nmarkers: sideways\n"
    "camera: {rate_hz: 100, marker_sd_m: 0.001}\n",
    "take.csv": "Format Version,1.23\n",
    "trials.csv": "trial,frequency_hz\na,1\n",
    "empty.yaml": "",
    "manoeuvre.json": '{"duration_s": 1}',
    "bare/manoeuvre.json": '{"start": {"gait": null}}',
    "half/manoeuvre.json": '{"start": {"gait": {"period_s": 1}}}',
    "unsolved/plan.json": '{"status": "timeout"}',
    "alone/plan.json": '{"status": "solved"}',
    "no_gaits/motion.json": json.dumps(MOTION | {"gaits": []}),
    "cycle/motion.json": json.dumps(MOTION | {"runs": [RUN | {"cycles": [[7, 0, None]]}]}),
    "still/motion.json": json.dumps(MOTION | {"runs": [RUN | {"cycles": []}]}),
    "short/motion.json": json.dumps(MOTION | {"runs": [RUN | {"clearance_mm": [1, 2, 3]}]}),
}
CASES = [
    ("srs_opt.simulate", ["--frequency", "fast"], 2, "expected a finite number"),
    ("srs_opt.simulate", ["--frequency", "-1"], 2, "above 0"),
    ("srs_opt.simulate", ["--frequenzy", "1"], 2, "unrecognized arguments"),
    ("srs_opt.simulate", ["--offset", "1.2"], 2, "between -1 and 1"),
    ("srs_opt.simulate", ["--duration", "1e9"], 2, "duration"),
    ("srs_opt.simulate", ["--frequency", "1e9"], 2, "cycles"),
    ("srs_opt.simulate", ["--frequency", "1e-308"], 2, "less than 1e-06 cycles"),
    ("srs_opt.simulate", ["--duration", "1e-12"], 2, "less than 1e-06 cycles"),
    ("srs_opt.simulate", ["--seed", "-1"], 2, "whole number from 0"),
    ("srs_opt.simulate", ["--robot", "{tmp}/absent.yaml"], 2, "no such file"),
    ("srs_opt.simulate", ["--robot", "{tmp}"], 2, "is a folder"),
    ("srs_opt.simulate", ["--robot", "{tmp}/typo.yaml"], 2, "typo.yaml:1: lenght: unknown key"),
    ("srs_opt.simulate", ["--robot", "{tmp}/negative.yaml"], 2, "greater than 0"),
    ("srs_opt.simulate", ["--robot", "{tmp}/text.yaml"], 2, "expected a whole number"),
    ("srs_opt.simulate", ["--robot", "{tmp}/twice.yaml"], 2, "given twice"),
    ("srs_opt.simulate", ["--robot", "{tmp}/effect.yaml"], 2, "did you mean 'tether_drag'"),
    ("srs_opt.simulate", ["--robot", "{tmp}/place.yaml"], 2, "segment number from 1"),
    ("srs_opt.simulate", ["--robot", "{tmp}/broken.yaml"], 2, "not valid YAML"),
    ("srs_opt.simulate", ["--robot", "{tmp}/latin.yaml"], 2, "not UTF-8"),
    ("srs_opt.simulate", ["--gait", "{tmp}/empty.csv"], 2, "expected"),
    ("srs_opt.simulate", ["--gait", "{tmp}/gait.json"], 2, "missing"),
    ("srs_opt.simulate", ["--gait", "{tmp}/table.json"], 2, "table.json"),
    ("srs_opt.simulate", ["--gait", "{tmp}/old_table.json:x"], 2, "version"),
    ("srs_opt.simulate", ["--robot", "{tmp}/empty.yaml"], 2, "empty.yaml: is empty"),
    ("srs_opt.simulate", ["--gait", "{tmp}/empty.yaml"], 2, "empty.yaml: is empty"),
    ("srs_opt.simulate", ["--pressure", "1e308"], 2, "more than a full turn"),
    ("srs_opt.gait_opt", ["--judge", "--robot", "{tmp}/cone.yaml"], 2, "per_axis"),
    ("srs_opt.gait_opt", ["--table", "--judge", "--robot", "{tmp}/stribeck.yaml"], 2, "does not build"),
    ("planners.plan", ["mazes/first.yaml", "--judge", "--true-robot", "{tmp}/cone.yaml"], 2, "per_axis"),
    ("srs_opt.judge", [], 2, "FILE"),
    ("srs_opt.judge", ["{tmp}/absent.json"], 2, "no such file"),
    ("srs_opt.judge", ["{tmp}/gait.json"], 2, "missing"),
    ("srs_opt.judge", ["{tmp}/table.json"], 2, "table.json"),
    ("srs_opt.judge", ["{tmp}/old_table.json"], 2, "version"),
    ("srs_opt.judge", ["{tmp}/empty.csv"], 2, "empty"),
    ("srs_opt.judge", ["{tmp}/motion.json"], 2, "expected keys"),
    ("srs_opt.judge", ["{tmp}/still/motion.json"], 2, "cannot be played"),
    ("srs_opt.judge", ["{tmp}/cycle/motion.json"], 2, "cannot be played"),
    ("srs_opt.judge", ["{tmp}/manoeuvre.json"], 2, "expected a key 'start'"),
    ("srs_opt.judge", ["{tmp}/bare/manoeuvre.json"], 2, "valves.csv"),
    ("srs_opt.judge", ["{tmp}/half/manoeuvre.json"], 2, "its gait lacks"),
    ("srs_opt.judge", ["{tmp}/unsolved/plan.json"], 2, "not a solved plan"),
    ("srs_opt.judge", ["{tmp}/alone/plan.json"], 2, "no such file"),
    ("srs_opt.judge", ["{tmp}/gait.json", "--step", "0"], 2, "above 0"),
    ("srs_opt.judge", ["{tmp}/gait.json", "--robot", "{tmp}/cone.yaml"], 2, "per_axis"),
    ("srs_opt.judge", ["{tmp}/gait.json", "--robot", "{tmp}/stribeck.yaml"], 2, "does not build effect"),
    ("srs_opt.gait_map", ["--frequency", "2", "1", "3"], 2, "LO <= HI"),
    ("srs_opt.gait_map", ["--frequency", "1", "2"], 2, "expected 3 arguments"),
    ("srs_opt.gait_map", ["--offset", "1.5"], 2, "between -1 and 1"),
    ("srs_opt.gait_map", ["--jobs", "0"], 2, "whole number above 0"),
    ("srs_opt.gait_map", ["--frequency", "1", "2", "9999", "--pressure", "9", "55", "9999"], 2, "too large"),
    ("srs_opt.gait_map", ["--cluster", "nowhere"], 2, "no Dask scheduler"),
    ("srs_opt.simulate", ["--valves", "{tmp}/absent.csv"], 2, "absent.csv"),
    ("srs_opt.simulate", ["--valves", "{tmp}/empty.csv"], 2, "empty.csv"),
    ("srs_opt.manoeuvre", [], 2, "--past, --turn"),
    ("srs_opt.manoeuvre", ["--past", "1", "--model", "compliant"], 2, "not optimized on the compliant"),
    ("srs_opt.manoeuvre", ["--past", "1", "--robot", "{tmp}/droop.yaml"], 2, "supply_droop"),
    ("srs_opt.manoeuvre", ["--past", "0"], 2, "must not be 0"),
    ("srs_opt.manoeuvre", ["--rest", "--to", "fast"], 2, "not both"),
    ("srs_opt.manoeuvre", ["--to", "fastest"], 2, "fastest"),
    ("srs_opt.manoeuvre", ["--past", "1", "--space", "{tmp}/absent.yaml"], 2, "no such file"),
    ("srs_opt.manoeuvre", ["--past", "1", "--space", "{tmp}/typo.yaml"], 2, "typo.yaml"),
    ("srs_opt.manoeuvre", ["--past", "1", "--pressure", "55", "41"], 2, "low <= high"),
    ("srs_opt.drive", [], 2, "--speed"),
    ("srs_opt.drive", ["--speed", "0.1", "--radius", "1", "--turn-rate", "1"], 2, "not both"),
    ("srs_opt.drive", ["--speed", "nan"], 2, "expected a finite number"),
    ("srs_opt.drive", ["--speed", "1e308", "--quiet"], 2, "at most 100 m/s"),
    ("srs_opt.drive", ["--speed", "0.1", "--turn-rate", "-1e308", "--quiet"], 2, "at most 1000 rad/s"),
    ("srs_opt.drive", ["--speed", "0.1", "--map", "{tmp}/map.csv"], 2, "map.csv:1: column 'frequency_hz'"),
    ("srs_opt.measurement", ["{tmp}/absent", "--quiet"], 2, "absent"),
    ("srs_opt.measurement", ["{tmp}/set", "--quiet"], 2, "dataset.yaml"),
    ("srs_opt.import_tracks", ["{tmp}/take.csv"], 2, "--trials"),
    ("srs_opt.import_tracks", ["{tmp}/take.csv", "--trials", "{tmp}/trials.csv"], 2, "trials.csv"),
    ("planners.plan", ["{tmp}/absent.yaml"], 2, "no such file"),
    ("planners.plan", ["{tmp}/walls.yaml"], 2, "did you mean 'segment'"),
    ("planners.plan", ["{tmp}/in_wall.yaml"], 2, "inside a wall"),
    ("planners.plan", ["{tmp}/no_goal.yaml"], 2, "no goal"),
    ("planners.plan", ["{tmp}/ros.yaml"], 2, "gone.pgm"),
    ("planners.plan", ["{tmp}/maze.txt"], 2, "maze.txt"),
    ("planners.plan", ["{tmp}/maze.map"], 2, "maze.map"),
    ("planners.plan", ["{tmp}/maze.world"], 2, "maze.world"),
    ("planners.plan", ["mazes/first.yaml", "--start", "1,2"], 2, "X,Y,HEADING"),
    ("planners.plan", ["mazes/first.yaml", "--cell", "0.1"], 2, "--scale"),
    ("planners.plan", ["mazes/first.yaml", "--gaits", "{tmp}/table.json"], 2, "table.json"),
    ("planners.plan", ["mazes/first.yaml", "--planner", "magic"], 2, "expected auto (plan only), lattice"),
    ("planners.plan", ["mazes/first.yaml", "--margin", "-1"], 2, "--margin"),
    ("planners.plan", ["mazes/first.yaml", "--margin", "5"], 2, "--margin"),
    ("planners.plan", ["mazes/first.yaml", "--scale", "1e-6"], 2, "start"),
    ("planners.plan", ["mazes/first.yaml", "--true-robot", "{tmp}/absent.yaml"], 2, "no such file"),
    ("planners.plan", ["mazes/first.yaml", "--drive", "{tmp}/table.json"], 2, "drive calibration"),
    ("planners.plan", ["mazes/first.yaml", "--animate", "film.avi"], 2, "film.avi"),
    ("srs_opt.gait_opt", ["--objective", "fame"], 2, "must be one of"),
    ("srs_opt.gait_opt", ["--frequency", "2", "1"], 2, "low <= high"),
    ("srs_opt.gait_opt", ["--objective", "slim"], 2, "--speed"),
    ("srs_opt.gait_opt", ["--radius", "0"], 2, "radius"),
    ("srs_opt.gait_opt", ["--radius", "1", "--turn-rate", "1"], 2, "not both"),
    ("srs_opt.gait_opt", ["--tick", "0"], 2, "--tick"),
    ("srs_opt.gait_opt", ["--valve-delay", "-1"], 2, "valve_delay_s: must be at least 0"),
    ("srs_opt.gait_opt", ["--min-dwell", "3"], 2, "--min-dwell"),
    ("srs_opt.gait_opt", ["--warm", "{tmp}/gait.json"], 2, "missing"),
    ("srs_opt.gait_opt", ["--robots", "{tmp}/absent.yaml"], 2, "no such file"),
    ("srs_opt.report", ["{tmp}/absent"], 2, "absent"),
    ("srs_opt.report", ["{tmp}/set"], 2, "dataset.yaml"),
    ("srs_opt.gait_opt", ["--stiffness", "0"], 2, "--stiffness"),
    ("srs_opt.gait_opt", ["--stiffness", "0.005", "--model", "complex"], 2, "--model compliant"),
    ("srs_opt.gait_opt", ["--stiffness", "0.005", "--table", "--warm", "x.json"], 2, "--table --warm"),
    ("srs_opt.gait_opt", ["--worst", "relative", "--table", "--model", "complex"], 2, "--worst"),
    ("srs_opt.gait_opt", ["--spread", "1.5"], 2, "--spread must be below 1"),
    ("srs_opt.gait_opt", ["--spread", "0.1", "--table"], 2, "not with --table"),
    ("srs_opt.gait_opt", ["--worst", "relative", "--objective", "transport"], 2, "--worst relative"),
    ("srs_opt.calibrate", ["{tmp}/absent"], 2, "absent"),
    ("srs_opt.calibrate", ["{tmp}/set"], 2, "dataset.yaml"),
    ("srs_opt.discrepancy", ["{tmp}/absent"], 2, "absent"),
    ("srs_opt.discrepancy", ["{tmp}/set", "--effects", "{tmp}/typo.yaml"], 2, "dataset.yaml"),
    ("planners.benchmark", ["{tmp}/absent.yaml"], 2, "no such file"),
    ("planners.benchmark", ["mazes/first.yaml", "--planner", "lattice,magic"], 2, "magic: expected"),
    ("planners.benchmark", ["mazes/first.yaml", "--runs", "0"], 2, "above 0"),
    ("planners.motion", ["--gaits", "{tmp}/absent.json"], 2, "no such file"),
    ("planners.motion", ["--gaits", "{tmp}/old_table.json"], 2, "version"),
    ("planners.generate", ["--rows", "0"], 2, "unrecognized"),
    ("planners.generate", ["--cells", "1"], 2, "4 to 200"),
    ("planners.generate", ["--style", "rooms", "--format", "txt"], 2, "write rooms as yaml"),
    ("planners.generate", ["--wall", "99"], 2, "too thick"),
    ("planners.generate", ["--cell", "1e-300"], 2, "expected 0.001 to 100 m"),
    ("planners.generate", ["--cell", "1e308"], 2, "expected 0.001 to 100 m"),
    ("planners.generate", ["--style", "corridor", "--length", "1e9"], 2, "--length"),
    ("planners.pilot", ["mazes/first.yaml"], 2, "--valves"),
    ("planners.pilot", ["mazes/first.yaml", "--valves", "{tmp}/absent", "--pose", "udp://:1"], 2, "opened"),
    ("planners.view", ["{tmp}/absent"], 2, "no such file"),
    ("planners.view", ["{tmp}/walls.yaml"], 2, "not valid JSON"),
    ("planners.view", ["{tmp}/motion.json"], 2, "motion.json"),
    ("planners.view", ["{tmp}/no_gaits"], 2, "index below 0"),
    ("planners.view", ["{tmp}/cycle"], 2, "runs[0].cycles[0]"),
    ("planners.view", ["{tmp}/still"], 2, "runs[0].cycles: is empty"),
    ("planners.view", ["{tmp}/short"], 2, "3 instants where centre has 2"),
    ("virtual_lab", ["--rate", "1e300"], 2, "--rate: expected at most"),
    ("virtual_lab", ["--duration", "1e7"], 2, "--duration: expected at most"),
    ("virtual_lab", ["--scale", "1e300", "--effect", "tether_drag"], 2, "--scale: expected at most"),
    ("virtual_lab", ["--bench-error", "1e300"], 2, "--bench-error: expected at most"),
]  # fmt: skip


@pytest.fixture
def files(tmp_path) -> Path:
    for name, content in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return tmp_path


def run(command: str, arguments: list[str], folder: Path, capsys) -> tuple[int, str, str]:
    """Run a command in this process: exit status, stdout, stderr."""
    try:
        module = importlib.import_module(f"{command}.__main__")
    except ModuleNotFoundError:
        module = importlib.import_module(command)
    given = [a.format(tmp=folder) for a in arguments]
    if "--out" not in given:
        given += ["--out", str(folder / "out")]
    main = getattr(module, "main", None)
    try:
        if main is not None:
            status = main(given)
        else:
            from srs_opt.command import run_command

            status = run_command(module.build_parser(), module.run, given)
    except SystemExit as stop:
        status = int(stop.code or 0)
    captured = capsys.readouterr()
    return status, captured.out, captured.err


@pytest.mark.parametrize(
    ("command", "arguments", "status", "words"),
    CASES,
    ids=[f"{command.split('.')[-1]} {' '.join(arguments)[:60]}" for command, arguments, _, _ in CASES],
)
def test_failure_is_one_line(command, arguments, status, words, files, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    found, out, err = run(command, arguments, files, capsys)
    lines = err.strip().splitlines()
    assert found == status, err
    assert len(lines) == 1, err
    assert words in lines[0]
    assert "Traceback" not in err
    assert not out
    assert not list(files.rglob(".partial-*"))


def test_failure_with_json_keeps_stdout_clean_or_one_object(files, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    _, out, err = run("srs_opt.simulate", ["--robot", "{tmp}/typo.yaml", "--json"], files, capsys)
    assert not out or isinstance(json.loads(out), dict)
    assert len(err.strip().splitlines()) == 1


def test_robot_that_does_not_fit_the_tracks(files, capsys):
    """A set of five markers, a robot of three links."""
    folder = files / "lines"
    (folder / "trials").mkdir(parents=True)
    texts = {
        "dataset.yaml": FILES["set/dataset.yaml"].replace("sideways", "tail_to_head"),
        "robot.yaml": "name: x\n",
        "trials.csv": "trial,frequency_hz,pressure_kpa,offset,phase_lag_rad,heading_rad,duration_s\n"
        "a,1,50,0,1.57,0,1\n",
        "three.yaml": "links: 3\n",
        "trials/a.csv": "time_s,x1_m,y1_m,x2_m,y2_m,x3_m,y3_m,x4_m,y4_m,x5_m,y5_m\n"
        + "".join(
            f"{k / 100:g}," + ",".join(f"{0.049 * i + 1e-4 * k:.4f},0" for i in range(5)) + "\n"
            for k in range(100)
        ),
    }
    for name, text in texts.items():
        (folder / name).write_text(text)
    status, out, err = run(
        "srs_opt.calibrate", [str(folder), "--robot", "{tmp}/lines/three.yaml"], files, capsys
    )
    assert status == 2, err
    assert "has 3 links" in err
    assert not out


def commands() -> list[str]:
    found = [
        ".".join(path.relative_to(ROOT).parent.parts)
        for package in ("srs_opt", "planners")
        for path in (ROOT / package).rglob("__main__.py")
    ]
    return sorted(found)


def test_every_command_has_failures_listed_here():
    assert set(commands()) - {command for command, *_ in CASES} - NOT_COMMANDS == set()


@pytest.mark.parametrize("command", commands())
def test_help_tells_units_and_an_example(command, capsys):
    status, out, _ = run(command, ["--help", "--out", "x"], Path(), capsys)
    assert status == 0
    assert "example:\n" in out
    for option in ("--out", "--json", "--quiet", "--seed"):
        assert option in out
    assert re.search(r"\b(m|Hz|kPa|rad|s)\b", out)


def test_more_than_fits_into_memory_is_one_line(capsys):
    from srs_opt.command import make_parser, run_command

    def greedy(options):
        raise MemoryError("Unable to allocate 56 TiB")

    assert run_command(make_parser("x", "y", "z"), greedy, []) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "56 TiB" in line and "ask for something shorter" in line


def test_points_beyond_the_horizon(files, capsys):
    """A coordinate of 1e308 m once passed, and the fit wrote a robot of not-a-number."""
    folder = files / "far"
    assert run("virtual_lab", ["--duration", "1", "--quiet", "--out", str(folder)], files, capsys)[0] == 0
    track = folder / "trials" / "t01.csv"
    lines = track.read_text(encoding="utf-8").splitlines()
    cells = lines[9].split(",")
    lines[9] = ",".join([*cells[:3], "1e308", *cells[4:]])
    track.write_text("\n".join(lines) + "\n", encoding="utf-8")
    status, _, err = run("srs_opt.calibrate", [str(folder), "--quiet"], files, capsys)
    assert status == 2
    assert "t01.csv:10: marker 2 stands 1e+308 m from the origin" in err


def test_a_bug_is_one_line_too(capsys, monkeypatch):
    from srs_opt.command import FAULT, make_parser, run_command

    def faulty(options):
        raise RuntimeError("a\nb")

    parser = make_parser("x", "y", "z")
    assert run_command(parser, faulty, []) == FAULT
    assert len(capsys.readouterr().err.splitlines()) == 1
    monkeypatch.setenv("SRS_OPT_TRACEBACK", "1")
    with pytest.raises(RuntimeError):
        run_command(parser, faulty, [])
