"""drives/<trial>.csv: what was applied, in pressures or valve states."""

import numpy as np
import pytest

from srs_opt.calibrate.trial_simulation import timeline_of
from srs_opt.errors import InputError
from srs_opt.measurement.dataset import load_dataset
from srs_opt.measurement.dataset import write_dataset as save
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.draw import draw_truth
from virtual_lab.trials import small_design

HEAD = "time_s," + ",".join(f"left{k}_kpa,right{k}_kpa" for k in range(1, 5))
STATES = "time_s,s1,s2,s3,s4"


@pytest.fixture
def folder(tmp_path):
    truth = draw_truth((), np.random.default_rng(1))
    design = small_design(np.random.default_rng(2), 1.0)[:1]
    write_dataset(tmp_path / "set", truth, design, 3, Recording(rate_hz=60.0))
    (tmp_path / "set" / "drives").mkdir()
    return tmp_path / "set"


def drive(folder, text):
    (folder / "drives" / "t01.csv").write_text(text)
    return load_dataset(folder).trials[0]


def test_pressures_states_and_the_timeline(folder):
    text = f"{HEAD}\n0,50,0,0,50,0,0,25,0\n0.3,0,40,40,0,0,0,0,0\n0.5,0,0,0,0,0,0,0,0\n"
    trial = drive(folder, text)
    np.testing.assert_allclose(trial.applied.state, [[1, -1, 0, 0.5], [-1, 1, 0, 0], [0, 0, 0, 0]])
    np.testing.assert_allclose(trial.applied.pressure_kpa, [50, 40, 0])
    played = timeline_of(trial, 4)
    np.testing.assert_allclose(np.cumsum(played.duration_s)[:2], [0.3, 0.5])
    # curvature follows pressure times S: the regulator's share goes into S
    np.testing.assert_allclose(played.valve[:, 1] * trial.pressure_kpa, [-40, 40, 0, 0])
    again = save(load_dataset(folder), folder.parent / "again")
    np.testing.assert_allclose(load_dataset(again).trials[0].applied.state, trial.applied.state)
    states = drive(folder, f"{STATES}\n0,1,-1,0,0.25\n0.4,-1,1,0,0\n")
    np.testing.assert_allclose(states.applied.state[0], [1, -1, 0, 0.25])
    assert set(states.applied.pressure_kpa) == {states.pressure_kpa}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time_s,left1_kpa\n0,1\n", "expected the columns"),
        (f"{STATES}\n0,1,0,0,0\n0,0,0,0,0\n", "ascend from 0"),
        (f"{STATES}\n0.1,1,0,0,0\n", "ascend from 0"),
        (f"{STATES}\n0,1,0,0,2\n", "between -1"),
        (f"{STATES}\n0,1,0,0,\n", "without gaps"),
        (f"{HEAD}\n0,-5,0,0,0,0,0,0,0\n", "not be negative"),
    ],
)
def test_bad_drives_are_told_in_one_line(folder, text, words):
    with pytest.raises(InputError, match=rf"drives/t01.csv.*{words}"):
        drive(folder, text)
