"""The command, as a program uses it: in process, JSON on stdout, exit status."""

import json
from pathlib import Path

import pytest

from planners.plan.__main__ import main

ROOT = Path(__file__).resolve().parents[2]
MAZES = ROOT / "mazes"


def run(capsys, tmp_path, *arguments):
    """Return exit status, the JSON object and stderr."""
    status = main([*map(str, arguments), "--json", "--quiet", "--out", str(tmp_path)])
    captured = capsys.readouterr()
    return status, json.loads(captured.out) if captured.out.strip() else None, captured.err


def test_first_maze_is_driven(capsys, tmp_path):
    status, answer, _ = run(capsys, tmp_path, MAZES / "first.yaml", "--execute")
    assert status == 0
    assert answer["status"] == "solved" and answer["certified"] is True
    assert answer["clearance_m"] >= 0.005 - 1e-6
    assert sum(step["cycles"] for step in answer["steps"]) > 5
    assert {"gait", "cycles", "reverse"} == set(answer["steps"][0])
    assert answer["path"][0] == {"t_s": 0.0, "x_m": 0.2, "y_m": 1.024, "heading_rad": 0.0}
    end = answer["path"][-1]
    assert (end["x_m"] - 1.35) ** 2 + (end["y_m"] - 0.2) ** 2 <= 0.0601**2
    assert answer["execution"]["reached"] is True and answer["execution"]["collisions"] == 0
    assert answer["reason"] is None
    assert (tmp_path / "plan.png").stat().st_size > 10_000
    assert json.loads((tmp_path / "plan.json").read_text())["steps"] == answer["steps"]


@pytest.mark.parametrize("maze", ["u_turn.yaml", "slalom.yaml", "rooms.yaml", "narrow.yaml", "blocks.yaml"])
def test_every_maze_is_solved(capsys, tmp_path, maze):
    status, answer, _ = run(capsys, tmp_path, MAZES / maze)
    assert status == 0 and answer["certified"]


def test_narrow_needs_a_slim_gait(capsys, tmp_path):
    from planners.motion.store import load_motion
    from planners.plan.__main__ import build_parser
    from planners.plan.inputs import gaits_from
    from srs_opt.robot import wpi_srs

    _, answer, _ = run(capsys, tmp_path, MAZES / "narrow.yaml")
    table = gaits_from(build_parser().parse_args([str(MAZES / "narrow.yaml")]), wpi_srs()).for_planning()
    bands = {entry.name: sum(entry.envelope_m) for entry in table.gaits}
    used = [bands[step["gait"]] for step in answer["steps"]]
    free_m = 0.082 - 2 * 0.005  # the passage less the margins
    assert bands["fast"] > free_m > min(used)
    assert load_motion(wpi_srs(), table).size == len(bands)


def test_no_way_is_said_quickly_and_where(capsys, tmp_path):
    status, answer, _ = run(capsys, tmp_path, MAZES / "no_way.yaml")
    assert status == 1
    assert answer["status"] == "infeasible" and answer["steps"] == [] and answer["certified"] is False
    assert "wide" in answer["reason"]
    assert answer["tightest"]["x_m"] == pytest.approx(1.0, abs=0.03)
    assert answer["planning_s"] < 20
    assert (tmp_path / "why_not.png").exists()


def test_costs_get_what_they_ask_for(capsys, tmp_path):
    answers = {}
    for cost in ("time", "length", "clearance", "air"):
        status, answers[cost], _ = run(capsys, tmp_path, MAZES / "rooms.yaml", "--cost", cost)
        assert status == 0 and answers[cost]["certified"] and answers[cost]["cost"] == cost
    fast = answers["time"]
    assert answers["length"]["length_m"] < fast["length_m"]
    assert answers["clearance"]["clearance_m"] > fast["clearance_m"]
    assert answers["air"]["air_j"] < 0.9 * fast["air_j"]


def test_planners_are_named_in_any_case():
    from planners.plan.__main__ import build_parser

    assert build_parser().parse_args(["maze.yaml", "--planner", "EST"]).planner == "est"


def test_costs_of_the_command_are_those_of_the_search():
    from planners.plan.__main__ import COSTS
    from planners.search import cost_model

    assert COSTS == cost_model.COSTS


def test_start_and_goal_in_walls_are_refused_at_once(capsys, tmp_path):
    for option, value in (("--start", "1.0,0.1,0"), ("--goal", "1.0,0.1"), ("--goal", "9,9")):
        status, answer, err = run(capsys, tmp_path, MAZES / "no_way.yaml", option, value)
        assert status == 2 and answer is None
        assert len(err.strip().splitlines()) == 1
        assert option[2:] in err


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["nothing.yaml"], "nothing.yaml"),
        ([MAZES / "first.yaml", "--margin", "-1"], "--margin"),
        ([MAZES / "first.yaml", "--gaits", "nothing.json"], "nothing.json"),
        ([MAZES / "first.yaml", "--robot", "nothing.yaml"], "nothing.yaml"),
        ([MAZES / "first.yaml", "--true-robot", "nothing.yaml"], "nothing.yaml"),
        ([MAZES / "first.yaml", "--animate", "film.avi"], ".gif"),
        ([MAZES / "first.yaml", "--cell", "0.2"], "cell size"),
    ],
)
def test_bad_input_is_one_line(capsys, tmp_path, arguments, word):
    status, answer, err = run(capsys, tmp_path, *arguments)
    assert status == 2 and answer is None
    assert len(err.strip().splitlines()) == 1 and word in err


@pytest.mark.parametrize("option", [["--start", "1,2"], ["--goal", "1,nan"]])
def test_bad_options_exit_2(option):
    with pytest.raises(SystemExit) as exit_:
        main([str(MAZES / "first.yaml"), *option])
    assert exit_.value.code == 2


def test_shipped_motion_table_fits_the_shipped_gaits():
    from importlib import resources

    from planners.motion.store import SHIPPED, table_key
    from srs_opt.gait_opt.catalogue import default_table
    from srs_opt.robot import wpi_srs

    key = table_key(wpi_srs(), default_table(wpi_srs()))
    shipped = resources.files("planners.motion") / SHIPPED / f"{key}.npz"
    assert shipped.is_file(), "run: python -m planners.motion --out planners/motion/shipped"


def test_animation(capsys, tmp_path):
    from PIL import Image

    film, short = tmp_path / "first.gif", ("--goal", "0.7,1.024")  # a frame takes 50 ms to draw
    status, _, _ = run(capsys, tmp_path, MAZES / "first.yaml", *short, "--animate", film)
    assert status == 0
    with Image.open(film) as image:
        assert image.n_frames > 20


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["rrt", "kpiece", "dubins-rrtconnect"])
def test_ompl_planners_find_certified_plans(capsys, tmp_path, planner):
    half = ("--goal", "1.4,0.612")  # out of the first of two U-turns: random searches take far less time
    status, answer, _ = run(
        capsys, tmp_path, MAZES / "first.yaml", *half, "--planner", planner, "--time-limit", "300"
    )
    assert status == 0
    assert answer["planner"] == planner and answer["certified"]
