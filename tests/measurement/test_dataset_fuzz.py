"""Whatever the bytes, a reader gives a result or an InputError."""

import contextlib
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from measure_fixtures import add_bench, write_set
from motive_writer import motive_csv

from srs_opt.errors import InputError
from srs_opt.measurement.dataset import load_dataset
from srs_opt.measurement.takes.formats import read_take
from srs_opt.measurement.validate import problems

FILES = [
    "dataset.yaml",
    "robot.yaml",
    "trials.csv",
    "trials/t1.csv",
    "maps.csv",
    "schedules/s.csv",
    "bench/steps.csv",
    "bench/spring_car.csv",
    "bench/tow.csv",
    "bench/checks.csv",
]
quiet = settings(
    max_examples=25,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
TEXT = st.text(
    alphabet=st.sampled_from(list("0123456789.,-+eE\n\r\"' ;:#[]{}nan_inft\t/\\é\x00xyms")), max_size=120
)


@pytest.fixture(scope="module")
def sound():
    with tempfile.TemporaryDirectory() as made:
        folder = write_set(Path(made) / "set", trials=1, seconds=0.5)
        add_bench(folder)
        (folder / "schedules").mkdir()
        (folder / "schedules" / "s.csv").write_text("segment,on_s,off_s,period_s\n1,0,0.1,0.5\n")
        (folder / "trials.csv").write_text(
            "trial,frequency_hz,pressure_kpa,offset,phase_lag_rad,heading_rad,duration_s,schedule\n"
            "t1,2,48,0,1.57,0,0.5,s\n"
        )
        (folder / "maps.csv").write_text(
            "frequency_hz,pressure_kpa,offset,phase_lag_rad,speed_m_s,speed_sd_m_s,radius_m,radius_sd_m,replicates\n"
            "1,41,0,1.5708,0.08,0.002,,,3\n"
        )
        assert problems(folder) == []
        yield folder


def read(folder):
    listed = problems(folder)
    if any(p.severity == "error" for p in listed):
        with pytest.raises(InputError) as caught:
            load_dataset(folder)
        assert "\n" not in str(caught.value)
    else:
        load_dataset(folder)


def test_a_cell_that_runs_over_lines_is_quoted_in_one(sound):
    track = sound / "trials" / "t1.csv"
    kept = track.read_bytes()
    lines = kept.decode().splitlines()
    cells = lines[3].split(",")
    lines[3] = ",".join([*cells[:-1], '"' + cells[-1]])
    lines[5] += '"'  # the cell goes on until here, and the row with it
    try:
        track.write_text("\n".join(lines) + "\n")
        said = problems(sound)
        assert any("expected a number" in p.message for p in said)
        assert all("\n" not in p.message for p in said)
        read(sound)
    finally:
        track.write_bytes(kept)


@pytest.mark.parametrize("file", FILES)
@given(data=st.data())
@quiet
def test_any_bytes_in_any_file(sound, file, data):
    path = sound / file
    before = path.read_bytes()
    cut = data.draw(st.integers(0, len(before)))
    kind = data.draw(st.sampled_from(["bytes", "insert", "replace"]))
    if kind == "bytes":
        new = data.draw(st.binary(max_size=200))
    else:
        text = data.draw(TEXT).encode()
        new = before[:cut] + text + before[cut + (len(text) if kind == "replace" else 0) :]
    try:
        path.write_bytes(new)
        read(sound)
    finally:
        path.write_bytes(before)


@given(data=st.data())
@quiet
def test_any_bytes_in_a_take(tmp_path, data):
    import numpy as np

    track = np.cumsum(np.full((4, 3, 2), 0.049), axis=1)
    before = motive_csv(track).encode()
    cut = data.draw(st.integers(0, len(before)))
    raw = data.draw(st.one_of(st.binary(max_size=80), TEXT.map(str.encode)))
    path = tmp_path / "take.csv"
    path.write_bytes(data.draw(st.sampled_from([raw, before[:cut] + raw + before[cut:], before[:cut] + raw])))
    with contextlib.suppress(InputError):
        assert read_take(path).marker_positions.shape[2] == 3
