"""Effects of a robot are part of the model everywhere; one's own take part, in worker processes too."""

import json

import pytest
from effect_lab import PLUGIN, small_set

from srs_opt.calibrate.__main__ import main as calibrate
from srs_opt.discrepancy.__main__ import main as discrepancy
from srs_opt.effects import plugins as effect_plugins
from srs_opt.effects import register_effect
from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter
from srs_opt.robot import load_robot, save_robot
from srs_opt.simulate.__main__ import main as simulate


@pytest.fixture(autouse=True)
def registry(monkeypatch):
    """Forget what a test registers."""
    from srs_opt import plugins

    monkeypatch.setattr(effect_plugins, "_own", {})
    monkeypatch.setattr(plugins, "_loaded", {})


def ask(command, folder, capsys, *options, out, jobs="1"):
    given = [str(folder), "--json", "--quiet", "--jobs", jobs, "--out", str(out), *map(str, options)]
    assert command(given) == 0
    return json.loads(capsys.readouterr().out)


def test_with_the_true_effect_in_the_robot_file_nothing_is_missing(tmp_path, capsys):
    truth = small_set(tmp_path / "set", ("tether_drag",))
    robot = load_robot(tmp_path / "set" / "robot.yaml")
    file = save_robot(robot.with_values(effects=truth.effects), tmp_path / "true.yaml")
    plain = ask(calibrate, tmp_path / "set", capsys, out=tmp_path / "plain")
    known = ask(calibrate, tmp_path / "set", capsys, "--robot", file, out=tmp_path / "known")
    assert plain["misfit"]["after"] > 1.1 > 1.03 > known["misfit"]["after"]
    assert known["robot"]["effects"] == [dict(e) for e in truth.effects]  # no deviation: as it was
    said = ask(discrepancy, tmp_path / "set", capsys, "--robot", file, out=tmp_path / "out")
    assert said["verdict"] == "no_gap"
    assert ["dead_time", "clock_offset"] in [p["effects"] for p in said["alike"]]


def test_any_number_of_processes_finds_the_same_numbers(tmp_path, capsys):
    small_set(tmp_path / "set", ("tether_drag",))
    names = tmp_path / "names.yaml"
    names.write_text("[tether_drag, tether_weight]\n")
    found = []
    for jobs in ("1", "2"):
        given = ("--effects", names)
        said = ask(discrepancy, tmp_path / "set", capsys, *given, out=tmp_path / "out", jobs=jobs)
        found.append({k: v for k, v in said.items() if k != "seconds"})
    assert found[0] == found[1]  # to the last bit
    assert found[0]["gap"]["ratio"] is not None


@pytest.mark.slow
def test_two_hidden_effects_are_named_one_after_the_other(tmp_path, capsys):
    truth = small_set(tmp_path / "set", ("tether_drag", "gap_bending"))
    names = tmp_path / "names.yaml"
    names.write_text("[tether_drag]\n")
    first = ask(discrepancy, tmp_path / "set", capsys, "--effects", names, out=tmp_path / "1")
    assert [e["name"] for e in first["effects"]] == ["tether_drag"]
    assert first["verdict"] == "named_in_part" and first["believed"]
    robot = ("--robot", first["corrected_robot"])
    second = ask(discrepancy, tmp_path / "set", capsys, *robot, out=tmp_path / "2")
    assert (second["verdict"], [e["name"] for e in second["effects"]]) == ("named", ["gap_bending"])
    robot = ("--robot", second["corrected_robot"])
    third = ask(discrepancy, tmp_path / "set", capsys, *robot, out=tmp_path / "3")
    assert third["verdict"] == "no_gap"
    found = {e["name"]: e for e in load_robot(second["corrected_robot"]).effects}
    for effect in truth.effects:
        (key,) = (k for k in effect if k != "name")
        entry = found[effect["name"]]
        assert abs(entry[key] - effect[key]) < 5 * entry["sd"][key]


@pytest.mark.slow
def test_a_plugins_effect_is_named_by_worker_processes_and_written_with_its_plugin(tmp_path, capsys):
    small_set(tmp_path / "set", ("viscous_rolling",))
    plugin = tmp_path / "mud_plugin.py"
    plugin.write_text(PLUGIN)
    names = tmp_path / "names.yaml"
    names.write_text("[my_rolling, tether_weight, head_mass]\n")
    given = ("--plugin", plugin, "--effects", names)
    said = ask(discrepancy, tmp_path / "set", capsys, *given, out=tmp_path / "out", jobs="2")
    assert (said["verdict"], said["effects"][0]["name"]) == ("named", "my_rolling")
    assert said["effects"][0]["look"] == "look at the wheels"
    assert load_robot(said["corrected_robot"]).plugins == ("mud_plugin.py",)


def test_a_robot_file_does_not_run_its_plugin_but_says_what_to_do(tmp_path, capsys):
    plugin, robot = tmp_path / "mud_plugin.py", tmp_path / "robot.yaml"
    plugin.write_text(PLUGIN)
    robot.write_text("effects: [{name: my_rolling, damping: 0.05}]\nplugins: [mud_plugin.py]\n")
    given = ["--robot", str(robot), "--duration", "1", "--quiet", "--out", str(tmp_path / "o")]
    assert simulate(given) == 2
    said = capsys.readouterr().err
    assert len(said.strip().splitlines()) == 1 and "--plugin mud_plugin.py" in said
    assert simulate(["--plugin", str(plugin), *given]) == 0


def test_an_effect_typed_into_a_program_reaches_worker_processes():
    from joblib import Parallel, delayed

    from srs_opt.gait import published_wave
    from srs_opt.orbit.steady import steady_gait
    from srs_opt.robot import wpi_srs

    size = EffectParameter("damping", "N s/m", 0.06, lower=0)
    register_effect(Effect("my_drag", "ground", (size,), rolling_force=lambda e, v: -e["damping"] * v))
    robot = wpi_srs().with_values(effects=[{"name": "my_drag", "damping": 0.05}])
    gait = published_wave(robot).gait()
    speeds = Parallel(n_jobs=2)(delayed(steady_gait)(robot, gait) for _ in range(2))
    assert [s.speed_m_s for s in speeds] == [steady_gait(robot, gait).speed_m_s] * 2
