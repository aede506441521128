"""bench/steps.csv made from filmed steps, against the curvatures that were played."""

import json

import numpy as np
import pytest
from measure_fixtures import ROBOT, ROBOT_YAML, track_text

from srs_opt.command import run_command
from srs_opt.measurement.__main__ import build_parser, run
from srs_opt.measurement.actuator_bench import combine_steps
from srs_opt.measurement.chain import chain_of, marker_positions
from srs_opt.measurement.dataset import load_dataset
from srs_opt.measurement.spots import named_layout
from srs_opt.measurement.steps import fit_steps


def main(argv):
    return run_command(build_parser(), run, argv)


HEADER = "trial,frequency_hz,pressure_kpa,offset,phase_lag_rad,heading_rad,duration_s,kind,floor\n"
ENDS = named_layout("chamber_ends", 5)


def filmed(folder, pressures, c0, sd=5e-5, tau=(0.08, 0.05)):
    """Step number k bends segment k of a resting robot by c0(pressure) after 0.1 s."""
    (folder / "trials").mkdir(parents=True)
    (folder / "robot.yaml").write_text(ROBOT_YAML)
    ends = ", ".join(f"{{segment: {s.segment}, at: {s.at:g}}}" for s in ENDS)
    camera = "camera: {rate_hz: 120, marker_sd_m: 0.00005}\n"
    (folder / "dataset.yaml").write_text(f"name: s\nrobot: robot.yaml\n{camera}markers: [{ends}]\n")
    rng, lines = np.random.default_rng(0), []
    time = np.arange(180) / 120
    t = np.maximum(time - 0.1, 0)
    rise = 1 - (tau[0] * np.exp(-t / tau[0]) - tau[1] * np.exp(-t / tau[1])) / (tau[0] - tau[1])
    for k, pressure in enumerate(pressures):
        q = np.zeros((180, 7))
        q[:, 3 + k % 4] = c0(pressure) * rise
        q[:, 5] += 0.4  # a bend at rest that is not the step's
        points = marker_positions(chain_of(ROBOT, ENDS), q)
        points = points - points[0, 0] + sd * rng.normal(size=points.shape)
        (folder / "trials" / f"s{k}.csv").write_text(track_text(time, points))
        lines.append(f"s{k},0,{pressure},0,0,0,1.5,step,{'lifted' if k % 2 else 'board'}\n")
    (folder / "trials.csv").write_text(HEADER + "".join(lines))
    return folder


def test_steps_are_what_was_played(tmp_path, capsys):
    folder = filmed(tmp_path / "s", [40, 40, 50, 50, 55, 55], lambda p: 0.35 * p)
    assert main([str(folder), "--steps", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["bench"]["steps"] == 6
    steps = load_dataset(folder).bench.steps
    assert [s.segment for s in steps] == [1, 2, 3, 4, 1, 2]
    assert [s.condition for s in steps] == ["ground", "lifted"] * 3
    for fit in fit_steps(steps):
        assert fit.c0_1_m == pytest.approx(0.35 * fit.pressure_kpa, rel=0.02)
        assert fit.tau1_s + fit.tau2_s == pytest.approx(0.13, abs=0.01)
    assert main([str(folder), "--steps", "--quiet"]) == 2  # never writes over a bench test
    assert "already" in capsys.readouterr().err


def test_c0_is_a_curve_where_it_is_not_proportional(tmp_path):
    def bent(p):
        return 0.45 * p - 0.002 * p**2

    for c0, curved in ((lambda p: 0.35 * p, False), (bent, True)):
        folder = filmed(tmp_path / str(curved), [20, 30, 40, 50, 60, 60], c0)
        text = (folder / "trials.csv").read_text().replace("board", "lifted")
        (folder / "trials.csv").write_text(text)
        assert main([str(folder), "--steps", "--quiet"]) == 0
        found = combine_steps(fit_steps(load_dataset(folder).bench.steps)).curvature[0].curve
        assert bool(found) is curved
        for value in found:
            assert value.c0_1_m == pytest.approx(c0(value.pressure_kpa), rel=0.02)


def test_without_filmed_steps_it_says_what_to_do(tmp_path, capsys):
    folder = filmed(tmp_path / "s", [40], lambda p: 14.0)
    text = (folder / "trials.csv").read_text().replace(",step,", ",still,")
    (folder / "trials.csv").write_text(text)
    assert main([str(folder), "--steps", "--quiet"]) == 2
    assert "kind step" in capsys.readouterr().err
    assert not (folder / "bench").exists()
