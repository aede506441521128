"""``import srs_opt as srs``: the ten lines, lazily, and one protocol for all results."""

import inspect
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import srs_opt as srs
from srs_opt.errors import NoAnswerError
from srs_opt.result import Result
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.draw import draw_truth
from virtual_lab.trials import small_design

MAZE = Path(__file__).resolve().parents[2] / "mazes" / "first.yaml"


@pytest.fixture(scope="module")
def robot():
    return srs.wpi_srs()


@pytest.fixture(scope="module")
def results(robot, tmp_path_factory):
    gait = srs.published_wave(robot, frequency_hz=2.0, pressure_kpa=55.0).gait()
    speeds = srs.gait_map(robot, frequencies_hz=[1, 2], pressures_kpa=[41, 55], offsets=[0, 0.4])
    drive = srs.drive_from_map(robot, speeds)
    route = srs.plan(MAZE, robot)
    folder = tmp_path_factory.mktemp("set") / "set"
    trials = small_design(np.random.default_rng(4))[:4]
    write_dataset(folder, draw_truth((), np.random.default_rng(3)), trials, 5, Recording())
    return {
        "simulate": srs.simulate(robot, gait, 2.0),
        "steady_gait": srs.steady_gait(robot, gait),
        "optimize_gait": srs.optimize_gait(robot, starts=1),
        "gait_map": speeds,
        "drive_from_map": drive,
        "gait_for": drive.gait_for(0.15, 0.2),
        "default_table": srs.default_table(robot),
        "plan": route,
        "drive_plan": srs.drive_plan(route),
        "calibrate": srs.calibrate(srs.load_dataset(folder)),
    }


def test_results_keep_one_protocol(results, tmp_path):
    for name, result in results.items():
        assert isinstance(result, Result), name
        assert 10 < len(repr(result)) < 300 and "\n" not in repr(result), name
        record = result.to_dict()
        assert record and json.loads(json.dumps(record, allow_nan=False)) == json.loads(json.dumps(record))
        assert result.save(tmp_path / name).stat().st_size > 20
        assert result.plot()
        assert result._repr_png_().startswith(b"\x89PNG")


def test_the_ten_lines_find_what_is_known(results):
    assert results["optimize_gait"].speed_m_s > 0.5
    assert results["steady_gait"].speed_m_s == pytest.approx(0.2315, abs=1e-3)
    assert results["plan"].solved and results["drive_plan"].execution.reached
    assert results["gait_for"].speed_m_s == pytest.approx(0.15, abs=1e-3)


def test_the_picture_numbers_the_gaits_along_the_path_and_shows_the_driven_clearance(results):
    above, below = results["drive_plan"].plot()
    gaits = dict.fromkeys(results["plan"].problem.motion.rows(results["plan"].plan.gaits))
    labels = [text.get_text() for text in above.figure.legends[0].get_texts()]
    numbers = [label.split()[0] for label in labels if label[0].isdigit()]
    assert numbers == [str(k) for k in range(1, len(gaits) + 1)]
    assert {"1"} <= {text.get_text() for text in above.texts} - {""} <= set(numbers)
    assert sum(line.get_linestyle() == "--" for line in below.lines) == 1


def test_ctrl_c_while_an_animation_is_written_is_ctrl_c(results, tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    from planners.view.animate import save_animation

    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(Figure, "savefig", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save_animation(tmp_path / "film.gif", results["plan"].problem, results["plan"].plan)
    assert not list(tmp_path.iterdir())


def test_no_way_is_told(robot):
    route = srs.plan(MAZE.with_name("no_way.yaml"), robot)
    assert not route.solved
    assert "infeasible" in repr(route) and "tightest" in repr(route)
    with pytest.raises(NoAnswerError, match="no way"):
        srs.drive_plan(route)
    assert route.plot()


@pytest.mark.parametrize("name", srs.__all__)
def test_every_name_is_there_and_documented(name):
    found = getattr(srs, name)
    assert inspect.getdoc(found)
    if not inspect.isclass(found):
        assert inspect.signature(found).parameters or name in ("wpi_srs",)


def test_an_unknown_name_is_told():
    with pytest.raises(AttributeError, match=r"no attribute 'gaits'; it has .*wpi_srs"):
        _ = srs.gaits


def test_import_is_lazy_and_submodules_do_not_hide_functions():
    program = (
        "import sys, srs_opt as srs; "
        "assert not {'numpy', 'casadi', 'planners', 'matplotlib'} & set(sys.modules); "
        "import srs_opt.simulate.run, srs_opt.calibrate.run, srs_opt.gait_map.grid; "
        "assert callable(srs.simulate) and callable(srs.calibrate) and callable(srs.gait_map); "
        "assert srs.simulate.run.simulate; assert set(srs.__all__) <= set(dir(srs))"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
