"""Every example runs, and its number is right."""

import importlib
import json
import math
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 80

# name: (value, tolerance, where the value comes from)
FAST = {
    "best_lag": (0.90, 0.15, "known: 0.544 m/s at lag 0.90, the fastest uniform wave at 2 Hz and 41 kPa"),
    "own_robot": (2.44, 0.1, "eight links against five, with less friction"),
    "soft_strobes": (
        1.18,
        0.03,
        "0.486 m/s, a robust gait another program knows, over the rigid optimum's 0.413",
    ),
    "own_effect": (0.89, 0.02, "share of speed kept on clogged wheels"),
}
SLOW = {
    "fig6_step_responses": (1.137, 0.01, "friction's 0.0099 N m over 0.005 N m^2, at 41 and 55 kPa"),
    "fig8_speed_map": (0.2315, 0.0005, "known: published gait, 2 Hz, 55 kPa"),
    "fig9_turning": (1.0, 0.05, "to first order the gap does what the paper's factor says"),
    "drive_factor": (1.163, 0.04, "a pitch longer by 57/49: to first order so is the radius"),
    "undulation_cost": (0.0, 30.0, "seconds, against the paper's 94"),
    "fig10_circle": (
        0.2485,
        0.004,
        "between the known radii at 41 and 55 kPa; the laboratory's v_s is finer",
    ),
    "fastest_gait": (0.557, 0.012, "at least the fastest wave known, 0.547 m/s"),
    "tightest_turn": (0.017, 0.0005, "CMA-ES of another program finds 0.0171 m at 0.02 m/s"),
    "slim_gait_gap": (0.065, 0.012, "slimmer than the passage less its margins, 78 mm"),
    "ros_map": (1.58, 0.12, "a little over the straight 1.55 m"),
    "calibrate_dataset": (1.5, 1.5, "all five truths within three standard deviations"),
    "motive_takes": (0.0, 0.008, "the valves' start, filmed at 120 Hz, within a frame"),
    "missing_effect": (0.0, 0.2, "at most a fifth of the gap is left"),
}


def check(name: str, value: float, tolerance: float, out: Path, monkeypatch) -> None:
    monkeypatch.chdir(ROOT)
    number = importlib.import_module(f"examples.{name}").main(out)
    assert math.isfinite(number)
    assert number == pytest.approx(value, abs=tolerance)
    for picture in out.glob("*.png"):
        assert picture.stat().st_size > 10_000
        assert picture.with_suffix(".svg").exists()


@pytest.mark.parametrize("name", FAST)
def test_example(name, tmp_path, monkeypatch):
    check(name, *FAST[name][:2], tmp_path, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_slow_example(name, tmp_path, monkeypatch):
    check(name, *SLOW[name][:2], tmp_path, monkeypatch)
    if name == "slim_gait_gap":
        record = json.loads((tmp_path / name / "plan.json").read_text(encoding="utf-8"))
        assert record["execution"]["reached"] and not record["execution"]["collisions"]
        assert len({step["gait"] for step in record["steps"]}) > 1


def test_every_example_is_short_and_tested():
    files = {p.stem: p for p in (ROOT / "examples").glob("*.py") if p.stem != "__init__"}
    assert set(files) == set(FAST) | set(SLOW)
    assert len(files) >= 10
    for path in files.values():
        text = path.read_text(encoding="utf-8")
        assert len(text.splitlines()) < LONGEST, path.name
        assert text.startswith('"""'), path.name


def test_generated_data_are_called_generated():
    for path in (ROOT / "examples").glob("*.py"):
        text = path.read_text(encoding="utf-8")
        if "virtual_lab" in text:
            assert "generated" in text.lower(), f"{path.name} must say that its data are generated"
