"""What a file outside the package can add, with nothing changed inside: one of each kind, in one plugin."""

import casadi as ca
import numpy as np
import pytest

from planners.maze import load
from planners.plan import registry as planners
from srs_opt import plugins
from srs_opt.calibrate.instruments import check_expectations
from srs_opt.calibrate.model import Model
from srs_opt.effects import known_effects
from srs_opt.effects import plugins as effects
from srs_opt.errors import InputError
from srs_opt.gait import Wave
from srs_opt.gait_opt.objectives.registry import OBJECTIVES
from srs_opt.judge.opinion import opinion_on
from srs_opt.judge.registry import JUDGES
from srs_opt.measurement.checks import compare_checks
from srs_opt.measurement.instruments import INSTRUMENTS
from srs_opt.measurement.records import Check
from srs_opt.measurement.takes import formats
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import MODELS, build
from srs_opt.robot import wpi_srs

PLUGIN = """
from pathlib import Path

import numpy as np

from srs_opt.judge.gaits import Judged
from srs_opt.judge.registry import Judge, register_judge
from srs_opt.measurement.instruments import Instrument, register_instrument
from srs_opt.model.complex import ComplexModel
from srs_opt.model.registry import register_model
from planners.maze.load import register_maze_format
from planners.maze.maze import Maze
from planners.maze.places import Pose
from planners.plan.registry import register_planner
from srs_opt.gait_opt.objectives.objective import Objective
from srs_opt.gait_opt.objectives.registry import register_objective
from srs_opt.measurement.takes.formats import TrackFormat, register
from srs_opt.measurement.takes.take import Take
from srs_opt.effects import register_effect
from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

register_effect(Effect("mud", "ground", (EffectParameter("damping", "N s/m", 0.06, lower=0),),
                       what="wheels in mud", look="look at the wheels",
                       rolling_force=lambda e, v: -e["damping"] * v))
register_objective(Objective("twice_the_speed", lambda cycle: 2 * cycle.speed_m_s))
register_planner("straight-on", lambda problem, effort: [0])

def read_box(path, cell_m, size):
    width, height = map(float, Path(path).read_text().split())
    return Maze("box", (0.0, 0.0, width, height), start=Pose(0.3, height / 2, 0.0))

register_maze_format(".box", read_box)

def read_dots(path, settings):
    rows = np.loadtxt(path, skiprows=1)
    seen = np.column_stack([rows[:, 1:], np.zeros(len(rows))])[:, None]
    return Take(path, path.stem, 1.0, rows[:, 0], ("a",), seen, flat=True)

class Sluggish(ComplexModel):
    name = "sluggish"

    def yaw_inertia(self):
        return 1.5 * super().yaw_inertia()

register_model(Sluggish)
def pitch(scene):
    return scene.parameter("segment_length_m") + scene.parameter("gap_length_m")

register_instrument(Instrument("pitch_m", "a ruler", 1e-4, lambda robot: robot.pitch_m, pitch))
register_judge(Judge("never", lambda: None, lambda robot: None,
                     lambda robot, gait, settings, refine: Judged(9.0, 0.0, None, None, None, 1, True)))
register(TrackFormat("dots", "dots", lambda path, data, text: text.startswith("dots"), read_dots))
"""


@pytest.fixture
def plugin(tmp_path, monkeypatch):
    """Run the plugin; forget afterwards what it registered."""
    for module, name in (
        (plugins, "_loaded"), (effects, "_own"), (OBJECTIVES, "own"), (MODELS, "own"),
        (INSTRUMENTS, "own"), (JUDGES, "own"), (planners, "_known"), (load, "_own"),
        (formats, "FORMATS"),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, getattr(module, name).copy())
    file = tmp_path / "everything.py"
    file.write_text(PLUGIN, encoding="utf-8")
    plugins.load_plugin(file)
    return tmp_path


def test_one_file_adds_a_model_an_instrument_and_a_judge(plugin):
    robot = wpi_srs()
    ours, theirs = (Structure.of(robot, name) for name in ("complex", "sluggish"))
    inertia = [
        ca.Function("j", [m.kappa, p.vector], [m.yaw_inertia()]) for p, m, _ in map(build, (ours, theirs))
    ]
    numbers = build(ours)[0].pack(robot, 40.0, 2.0)
    bent = np.array([1.0, 2.0, 3.0, -4.0])
    assert float(inertia[1](bent, numbers)) == pytest.approx(1.5 * float(inertia[0](bent, numbers)))
    (read,) = compare_checks([Check("pitch_m", 0.0491, 1e-4)], robot)
    assert read.deviations == pytest.approx(1.0)
    expected = check_expectations(Model(robot))["pitch_m"]
    assert expected({}) == pytest.approx(robot.pitch_m)
    gait = Wave.uniform(4, 2.0, 40.0, 1.2, 0.0).gait()
    opinion = opinion_on(robot, "a", gait, engine="never")
    assert opinion.judge.speed_m_s == 9.0
    assert not opinion.agrees


@pytest.mark.parametrize(
    ("registry", "word"), [(MODELS, "model"), (JUDGES, "judge"), (INSTRUMENTS, "instrument")]
)
def test_what_is_not_known_or_of_another_kind_is_refused(registry, word):
    with pytest.raises(InputError, match=f"{word} must be one of"):
        registry.named("no_such_thing")
    with pytest.raises(InputError, match=f"no {word}"):
        registry.register("a string")


def test_a_command_lists_the_models_that_there_are(capsys):
    from srs_opt.simulate.__main__ import main

    assert main(["--model", "sluggish", "--out", "nowhere"]) == 2
    assert "unknown model 'sluggish'" in capsys.readouterr().err


def test_one_file_adds_an_effect_an_objective_a_planner_a_maze_format_and_a_track_format(plugin):
    assert known_effects()["mud"].what == "wheels in mud"
    assert OBJECTIVES.named("twice_the_speed").name == "twice_the_speed"
    assert planners.planner_named("straight-on").search(None, None) == [0]
    (plugin / "a.box").write_text("2 0.6", encoding="utf-8")
    maze = load.load_maze(plugin / "a.box", scale=2.0)
    assert (maze.width_m, maze.height_m, maze.start.x) == (4.0, 1.2, 0.6)
    (plugin / "a.csv").write_text("dots\n0 0.1 0.2\n1 0.3 0.4\n", encoding="utf-8")
    take = formats.read_take(plugin / "a.csv")
    assert take.marker_positions[1, 0] == pytest.approx((0.3, 0.4, 0.0))


@pytest.mark.parametrize("ending", ["box", ".BOX", ".yaml"])
def test_an_ending_that_is_none_or_taken_is_refused(ending):
    with pytest.raises(InputError, match="maze format"):
        load.register_maze_format(ending, lambda path, cell_m, size: None)
