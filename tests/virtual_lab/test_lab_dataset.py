"""Data sets on disk and the command that writes them."""

import csv
import hashlib
import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import yaml

from virtual_lab.__main__ import main
from virtual_lab.dataset import Recording, tracks, write_dataset
from virtual_lab.draw import BENCH_SD, draw_truth
from virtual_lab.errors import LabError
from virtual_lab.trials import design, large_design, small_design, without_tether
from virtual_lab.truth import Truth


def table(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def digest(folder):
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(Path(folder).rglob("*"))
        if p.is_file()
    }


def short(duration=0.3):
    return small_design(np.random.default_rng(0), duration)


def test_small_design_is_balanced():
    trials = design("small", np.random.default_rng(5))
    assert len(trials) == 12
    for field, count in (("frequency_hz", 4), ("pressure_kpa", 4), ("offset", 4), ("heading_rad", 3)):
        assert set(Counter(getattr(t, field) for t in trials).values()) == {count}
    first = {t.name: t for t in trials}
    for again in trials[9:]:
        origin = first[again.replicate_of]
        assert (again.frequency_hz, again.pressure_kpa, again.offset) == (
            origin.frequency_hz, origin.pressure_kpa, origin.offset)  # fmt: skip
        assert again.heading_rad != origin.heading_rad


def test_large_design_is_a_factorial_with_replicates():
    trials = large_design(np.random.default_rng(5))
    assert len(trials) == 33
    counts = Counter((t.frequency_hz, t.pressure_kpa, t.offset) for t in trials)
    assert len(counts) == 27
    assert sorted(counts.values())[-4:] == [1, 3, 3, 3]
    assert {t.replicate_of for t in trials[27:]} <= {t.name for t in trials[:27]}


def test_same_seed_same_files(tmp_path):
    truth = draw_truth("tether_drag+crosstalk", np.random.default_rng(1))
    a = write_dataset(tmp_path / "a" / "set", truth, short(), 7)
    b = write_dataset(tmp_path / "b" / "set", truth, short(), 7)
    c = write_dataset(tmp_path / "c" / "set", truth, short(), 8)
    assert digest(a) == digest(b)
    assert digest(a)["trials/t01.csv"] != digest(c)["trials/t01.csv"]


def test_layout_and_numbers(tmp_path):
    truth = draw_truth("none", np.random.default_rng(1))
    folder = write_dataset(tmp_path / "set", truth, short(), 7, Recording(lost=0.1, stated_sd_m=0.002))
    about = yaml.safe_load((folder / "dataset.yaml").read_text())
    assert about["camera"] == {"rate_hz": 120.0, "marker_sd_m": 0.002}
    robot = yaml.safe_load((folder / "robot.yaml").read_text())
    assert robot["friction_normal"] == 0.57
    assert robot["relative_sd"] == dict(BENCH_SD)
    assert "effects" not in robot or robot["effects"] == []
    trials = table(folder / "trials.csv")
    assert [t["trial"] for t in trials] == [f"t{n:02d}" for n in range(1, 13)]
    rows = table(folder / "trials" / "t04.csv")
    assert list(rows[0])[:3] == ["time_s", "x1_m", "y1_m"]
    assert len(rows[0]) == 11
    assert [float(r["time_s"]) for r in rows] == pytest.approx(np.arange(36) / 120, abs=1e-6)
    cells = [(r[f"x{i}_m"], r[f"y{i}_m"]) for r in rows for i in range(1, 6)]
    lost = [c for c in cells if c == ("", "")]
    assert 0 < len(lost) < len(cells) / 2
    assert all(("" in c) == (c == ("", "")) for c in cells)
    hidden = json.loads((tmp_path / "set.truth.json").read_text())
    assert hidden["truth"]["parameters"]["friction_normal"] == truth.parameters.friction_normal
    assert not list(folder.rglob("*truth*"))


def test_noise_has_its_size():
    truth = Truth()
    found = list(tracks(truth, short(), 3, Recording(lost=0.0)))
    clean = list(tracks(truth, short(), 3, Recording(lost=0.0, marker_sd_m=0.0)))
    noise = np.concatenate([(a[2] - b[2]).ravel() for a, b in zip(found, clean)])
    assert noise.std() == pytest.approx(0.001, rel=0.05)
    assert abs(noise.mean()) < 5e-5


def test_centre_of_mass_tracks(tmp_path):
    folder = write_dataset(
        tmp_path / "set", Truth(), short(), 7, Recording(markers="centre_of_mass", lost=0.0)
    )
    rows = table(folder / "trials" / "t01.csv")
    assert list(rows[0]) == ["time_s", "x_m", "y_m"]
    assert np.hypot(float(rows[0]["x_m"]), float(rows[0]["y_m"])) == pytest.approx(0.098, abs=0.005)


def test_schedules_and_tether_are_told(tmp_path):
    trials = without_tether(design("steps", np.random.default_rng(0), 5, 0.5), [1])
    folder = write_dataset(tmp_path / "set", Truth(), trials, 7)
    rows = table(folder / "trials.csv")
    assert [r["tether"] for r in rows] == ["yes", "no", "yes", "yes"]
    assert {r["kind"] for r in rows} == {"step"}
    assert table(folder / rows[2]["schedule"]) == [
        {"segment": "3", "on_s": "0.000000", "off_s": "0.250000", "period_s": "0.500000"}
    ]


def test_bench_is_near_the_truth(tmp_path):
    truth = draw_truth("tether_weight", np.random.default_rng(4), (1.0, 1.0))
    folder = write_dataset(tmp_path / "set", truth, short(), 7, Recording(bench=True))
    cars = table(folder / "bench" / "spring_car.csv")
    for direction, value in (
        ("tangential", truth.parameters.friction_tangential),
        ("normal", truth.parameters.friction_normal),
    ):
        mu = [
            float(c["spring_n_m"]) * float(c["deflection_m"]) / (float(c["car_mass_kg"]) * 9.81)
            for c in cars
            if c["direction"] == direction
        ]
        assert np.mean(mu) == pytest.approx(1.06 * value, rel=0.06)
    checks = {
        c["quantity"]: (float(c["value"]), float(c["sd"])) for c in table(folder / "bench" / "checks.csv")
    }
    assert checks["tail_load_n"][0] == pytest.approx(0.03 * 9.81 + 0.2, abs=4 * checks["tail_load_n"][1])
    assert checks["ruler_scale"][0] == pytest.approx(1.0, abs=4 * checks["ruler_scale"][1])
    steps = table(folder / "bench" / "steps.csv")
    assert {s["condition"] for s in steps} == {"lifted", "ground"}
    assert {s["segment"] for s in steps} == {"1", "2", "3", "4"}
    tow = table(folder / "bench" / "tow.csv")
    with_hose = np.mean([float(t["force_n"]) for t in tow if t["with_tether"] == "yes"])
    without = np.mean([float(t["force_n"]) for t in tow if t["with_tether"] == "no"])
    assert with_hose - without == pytest.approx(0.2 * truth.parameters.friction_tangential, abs=0.004)


def test_maps_of_known_gaits(tmp_path):
    gaits = [t for t in large_design(np.random.default_rng(0)) if t.name in ("t25", "t26", "t27")]
    folder = write_dataset(tmp_path / "set", Truth(), gaits, 7, Recording(maps=True, tracks=False))
    assert not (folder / "trials.csv").exists()
    right, straight, left = table(folder / "maps.csv")
    assert float(straight["speed_m_s"]) == pytest.approx(0.2315, rel=0.05)
    assert straight["radius_m"] == ""
    assert float(left["radius_m"]) == pytest.approx(0.2473, rel=0.1)
    assert float(right["radius_m"]) == pytest.approx(-0.2473, rel=0.1)
    assert float(left["speed_sd_m_s"]) > 0
    assert left["replicates"] == "3"


def test_draws_differ_from_the_bench_by_its_stated_errors():
    errors = []
    for seed in range(200):
        truth = draw_truth("none", np.random.default_rng(seed))
        errors.append(
            [(getattr(truth.parameters, k) / getattr(truth.bench, k) - 1) / sd for k, sd in BENCH_SD.items()]
        )
    assert np.std(errors) == pytest.approx(0.95, abs=0.08)
    assert np.max(np.abs(errors)) <= 2.0 + 1e-9
    exact = draw_truth("none", np.random.default_rng(0), bench_error=0.0)
    assert exact.parameters == exact.bench


def test_sizes_and_signs_are_drawn():
    sizes = [
        draw_truth("camera_scale", np.random.default_rng(s)).effects[0]["scale"] / 0.03 for s in range(100)
    ]
    assert np.min(np.abs(sizes)) > 0.7
    assert np.max(np.abs(sizes)) < 1.4
    assert 25 < np.sum(np.array(sizes) > 0) < 75
    places = {draw_truth("single_wheel_toe", np.random.default_rng(s)).effects[0]["link"] for s in range(60)}
    assert places == {1, 2, 3, 4, 5}


def test_command(tmp_path, capsys):
    argv = ["--effect", "tether_drag", "--scale", "1", "--duration", "0.2", "--seed", "3", "--json"]
    assert main([*argv, "--out", str(tmp_path / "set")]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["hidden"] == ["tether_drag"]
    hidden = json.loads(Path(answer["truth"]).read_text())
    assert hidden["truth"]["effects"] == [{"name": "tether_drag", "force_n": 0.035}]
    assert main(["--duration", "0.2", "--quiet", "--out", str(tmp_path / "set")]) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--effect", "nothing"], "no effect is called 'nothing'"),
        (["--seed", "-1"], "--seed"),
        (["--duration", "0"], "duration"),
        (["--rate", "0"], "rate_hz"),
    ],
)
def test_command_refuses_in_one_line(tmp_path, capsys, argv, words):
    assert main([*argv, "--out", str(tmp_path / "set")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_command_leaves_other_folders_alone(tmp_path, capsys):
    (tmp_path / "thesis.txt").write_text("years of work")
    assert main(["--duration", "0.1", "--out", str(tmp_path)]) == 2
    assert "not a data set" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.txt"]


def test_trials_need_names_of_their_own(tmp_path):
    with pytest.raises(LabError, match="own name"):
        write_dataset(tmp_path / "set", Truth(), short() * 2, 1)
