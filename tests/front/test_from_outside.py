"""What a file outside the package can add, with nothing changed inside: one of each kind, in one plugin."""

import pytest

from planners.maze import load
from planners.plan import registry as planners
from srs_opt import plugins
from srs_opt.effects import known_effects
from srs_opt.effects import plugins as effects
from srs_opt.errors import InputError
from srs_opt.gait_opt.objectives import registry as objectives
from srs_opt.measurement.takes import formats

PLUGIN = """
from pathlib import Path

import numpy as np

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

register(TrackFormat("dots", "dots", lambda path, data, text: text.startswith("dots"), read_dots))
"""


@pytest.fixture
def plugin(tmp_path, monkeypatch):
    """Run the plugin; forget afterwards what it registered."""
    for module, name in (
        (plugins, "_loaded"), (effects, "_own"), (objectives, "_own"), (planners, "_known"), (load, "_own"),
        (formats, "FORMATS"),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, getattr(module, name).copy())
    file = tmp_path / "everything.py"
    file.write_text(PLUGIN, encoding="utf-8")
    plugins.load_plugin(file)
    return tmp_path


def test_one_file_adds_an_effect_an_objective_a_planner_a_maze_format_and_a_track_format(plugin):
    assert known_effects()["mud"].what == "wheels in mud"
    assert objectives.objective_named("twice_the_speed").name == "twice_the_speed"
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
