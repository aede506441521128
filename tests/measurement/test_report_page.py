"""The page about a data set: its numbers against counts made by hand, and that it needs no other file."""

import json
import re

import numpy as np
import pytest
from measure_fixtures import gait_track, track_text, write_set

from srs_opt.report.__main__ import main
from srs_opt.report.seen import _longest_run


@pytest.fixture
def folder(tmp_path):
    found = write_set(tmp_path / "set", trials=1, seconds=3.0)
    track = next((found / "trials").glob("*.csv"))
    time, points = gait_track(seconds=3.0)
    points[30:42, 2] = np.nan
    track.write_text(track_text(time, points))
    return found


def test_page_and_numbers(folder, tmp_path, capsys):
    assert main([str(folder), "--json", "--out", str(tmp_path / "out")]) == 0
    answer = json.loads(capsys.readouterr().out)
    trial = answer["trials"][0]
    assert trial["lost"] == pytest.approx([0, 0, 12 / 360, 0, 0], abs=1e-6)
    assert trial["longest_gap_s"] == pytest.approx(12 / 120)
    # the track is a made-up wriggle at 0.2 m/s: its chords change length, the robot.s do not
    assert 0.0003 < trial["residual_m"]["shape"] < 0.003 < trial["residual_m"]["model"]
    speed = trial["motion"]["speed_m_s"]
    assert speed["value"] == pytest.approx(0.2, abs=0.005)
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 3
    assert "Bends" in page and "90 % bands" in page
    assert "Lost markers" in page and f"{speed['value']:.4g}" in page
    assert not re.search(r'(src|href)="(?!data:|#)', page)
    for warning in trial["warnings"]:
        assert warning.split("'")[0] in page


def test_faulty_set_is_refused_with_the_place(folder, tmp_path, capsys):
    (folder / "dataset.yaml").write_text("name: x\n")
    assert main([str(folder), "--out", str(tmp_path / "out")]) == 2
    assert "dataset.yaml" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_longest_run():
    assert _longest_run(np.array([0, 1, 1, 0, 1, 1, 1], bool)) == 3
    assert _longest_run(np.zeros(4, bool)) == 0
