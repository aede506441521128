"""Gait tables: what ships, what controllers get, and the C player tick by tick."""

import csv
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from srs_opt.controller.c_source import c_source, write_program
from srs_opt.controller.program import ControllerLimits, Program
from srs_opt.errors import InputError
from srs_opt.gait import Wave
from srs_opt.gait_opt import family
from srs_opt.gait_opt.__main__ import main
from srs_opt.gait_opt.catalogue import default_table, shipped_table
from srs_opt.gait_opt.continuation import Stage
from srs_opt.gait_opt.export import write_csv
from srs_opt.gait_opt.family import build_table
from srs_opt.gait_opt.table import GaitTable, load_table, save_table
from srs_opt.gait_opt.table_spec import TableSpec, generations, table_specs
from srs_opt.gait_opt.ticks import LEFT_BIT, RIGHT_BIT, Schedule
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs

ROBOT = wpi_srs()
TICK_S = 0.001
FIRMWARE = Path(__file__).resolve().parents[2] / "firmware"
PLAYER = Path(__file__).resolve().parents[2] / "examples" / "gait_player" / "player.c"


@pytest.fixture(scope="module")
def table() -> GaitTable:
    return shipped_table()


def test_shipped_table_holds_what_a_planner_needs(table):
    assert len(table.gaits) >= 60
    straight = [g for g in table.gaits if g.radius_m is None]
    assert max(g.speed_m_s for g in straight) >= 0.545
    assert min(g.speed_m_s for g in straight) <= -0.545
    bands = sorted(sum(g.envelope_m) for g in straight if g.speed_m_s > 0.2)
    assert bands[0] <= 0.053
    assert max(np.diff([b for b in bands if b < 0.08])) < 0.007
    tight = [g for g in table.gaits if g.radius_m is not None and 0.09 < abs(g.radius_m) < 0.13]
    for side in (1, -1):
        for way in (1, -1):
            slim = [g for g in tight if side * g.radius_m > 0 and way * g.speed_m_s > 0.2]
            assert min(sum(g.envelope_m) for g in slim) <= 0.0605
    for side in (1, -1):
        radii = [side * g.radius_m for g in table.gaits if g.radius_m and side * g.radius_m > 0]
        assert min(radii) < 0.12
        assert max(radii) > 0.7


def test_shipped_gaits_do_what_the_table_says(table):
    for entry in table.gaits[:: max(len(table.gaits) // 8, 1)]:
        orbit = steady_gait(ROBOT, entry.gait)
        assert orbit.speed_m_s == pytest.approx(entry.speed_m_s, rel=2e-3)
        assert orbit.turn_rate_rad_s == pytest.approx(entry.turn_rate_rad_s, abs=5e-3)
        assert sum(orbit.envelope_m) == pytest.approx(sum(entry.envelope_m), rel=2e-2)


@pytest.mark.parametrize("radius_m", [0.784, 0.314, 0.176, 0.118])
def test_no_plain_wave_turns_faster_than_the_table(table, radius_m):
    """Waves of three pressures and two lags, their offset found by bisection so that they turn as tightly."""
    (entry,) = [g for g in table.gaits if g.name == f"fast R{radius_m:g} left"]
    for pressure_kpa in (40.0, 48.0, 55.0):
        for lag_rad in (0.9, 1.05):
            speed_m_s = _speed_on_circle(pressure_kpa, lag_rad, radius_m)
            assert speed_m_s <= 1.003 * entry.speed_m_s


def _speed_on_circle(pressure_kpa, lag_rad, radius_m):
    low, high = 0.0, 0.8
    for _ in range(14):
        offset = (low + high) / 2
        orbit = steady_gait(ROBOT, Wave.uniform(4, 2.0, pressure_kpa, lag_rad, offset).gait())
        low, high = (offset, high) if orbit.turn_rate_rad_s < orbit.speed_m_s / radius_m else (low, offset)
    return orbit.speed_m_s if abs(orbit.turn_rate_rad_s * radius_m / orbit.speed_m_s - 1) < 0.01 else 0.0


def test_images_are_mirror_images(table):
    left = {g.name: g for g in table.gaits if g.name.endswith(" left") and "back" not in g.name}
    for name, entry in left.items():
        other = table[name.replace("left", "right")]
        if name.startswith("pivot"):  # on the spot, rounding decides whether the path runs ahead
            assert abs(other.speed_m_s) == pytest.approx(abs(entry.speed_m_s), abs=1e-5)
            assert sorted(other.envelope_m) == pytest.approx(sorted(entry.envelope_m), abs=2e-3)
        else:
            assert other.speed_m_s == pytest.approx(entry.speed_m_s, rel=1e-3)
            assert other.envelope_m == pytest.approx(entry.envelope_m[::-1], rel=0, abs=1e-4)
        assert other.turn_rate_rad_s == pytest.approx(-entry.turn_rate_rad_s, rel=2e-3)


def test_default_table_of_the_built_in_robot(table):
    assert default_table(ROBOT).fingerprint == table.fingerprint


def test_table_of_another_robot_is_refused(table, tmp_path):
    path = save_table(table, tmp_path / "table.json")
    with pytest.raises(InputError, match="rebuild"):
        load_table(path, ROBOT.with_values(tau1_s=0.1))


def test_every_wish_starts_from_one_of_an_earlier_generation():
    asked = table_specs(ROBOT)
    assert len({w.name for w in asked}) == len(asked)
    done = {None}
    for group in generations(asked):
        assert {w.after for w in group} <= done
        done |= {w.name for w in group}
    assert len(done) == len(asked) + 1


def test_csv_has_a_row_per_interval(table, tmp_path):
    with write_csv(table, tmp_path / "t.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == sum(len(p) for g in table.gaits for p in g.gait.intervals)
    assert float(rows[0]["speed_m_s"]) == table.gaits[0].speed_m_s


def test_schedule_is_the_gait_at_every_tick(table):
    for entry in table.gaits[::7]:
        schedule = Schedule.of_gait(entry.gait, TICK_S)
        for tick in range(schedule.period):
            states = entry.gait.valve((tick + 0.5) * TICK_S)
            mask = sum((LEFT_BIT if s > 0 else RIGHT_BIT) << (2 * i) for i, s in enumerate(states))
            assert schedule.mask(tick) == mask


def test_schedule_refuses_times_between_ticks(table):
    with pytest.raises(InputError, match="ticks"):
        Schedule.of_gait(table.gaits[0].gait, 0.0037)


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_player_in_c_plays_every_tick(table, tmp_path):
    # a cycle may begin in the middle of a pulse: without the dwell guard every tick is as the table says
    written = Program.of_table(table, TICK_S, ControllerLimits(dwell_s=0.0))
    write_program(written, tmp_path / "gait_table.h")
    program = tmp_path / "player"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-I", str(tmp_path), "-I", str(FIRMWARE)]
    sources = [str(PLAYER), str(FIRMWARE / "srs_player.c")]
    subprocess.run(["cc", *flags, *sources, "-o", str(program)], check=True)
    for entry in [*table.gaits[::9], table["slow 0.02 back"], table["pivot 0.6 right"]]:
        speed, turn = round(1e3 * entry.speed_m_s), round(1e3 * entry.turn_rate_rad_s)
        schedule = Schedule.of_gait(entry.gait, TICK_S)
        ticks = 2 * schedule.period + 17
        done = subprocess.run(
            [str(program), str(speed), str(turn), str(ticks)], capture_output=True, text=True, check=True
        )
        played = table.gaits[int(done.stderr.split()[1])]
        assert played is table.nearest(1e-3 * speed, 1e-3 * turn)
        assert (played.speed_m_s, played.turn_rate_rad_s) == pytest.approx(
            (entry.speed_m_s, entry.turn_rate_rad_s), abs=0.02
        )
        schedule = Schedule.of_gait(played.gait, TICK_S)
        lines = done.stdout.split()
        assert lines[-1] == "-" * ROBOT.segments
        expected = [
            "".join("-LR"[schedule.mask(t) >> (2 * i) & 3] for i in range(ROBOT.segments))
            for t in range(ticks)
        ]
        assert lines[:-1] == expected
    for speed, turn in ((0, 0), (0, 6000), (0, 2000), (9999, 0)):
        done = subprocess.run([str(program), str(speed), str(turn), "30"], capture_output=True, text=True)
        assert "no gait is near" in done.stderr and set(done.stdout.split()) == {"----"}
        assert table.nearest(1e-3 * speed, 1e-3 * turn) is None


def test_header_never_opens_both_valves(table):
    text = c_source(Program.of_table(table, TICK_S))
    masks = [int(word, 16) for word in re.findall(r"\{(0x[0-9a-f]+)u\}", text)]
    assert masks
    assert all(mask & (mask >> 1) & 0x55555555 == 0 for mask in masks)


def test_nearest_gait(table):
    assert table.nearest(0.55, 0.0).speed_m_s > 0.5
    assert np.sign(table.nearest(0.4, -3.0).turn_rate_rad_s) == -1


def test_a_quick_table_asks_for_little():
    asked = table_specs(ROBOT, quick=True)
    assert [spec.after for spec in asked] == [None, "fast", "fast", asked[2].name]
    assert [spec.load for spec in asked] == [0.0] * 4
    assert {spec.radius_m for spec in asked} < {spec.radius_m for spec in table_specs(ROBOT)}


@pytest.mark.parametrize("words", [["--quick"], ["--table", "--quick", "--warm", "gait_table.json"]])
def test_quick_is_for_new_tables(words, capsys):
    assert main(words) == 2
    assert "--quick" in capsys.readouterr().err


@pytest.fixture
def short_table(monkeypatch):
    """Make tables of three coarse gaits."""
    asked = (
        TableSpec("a", None, None, None),
        TableSpec("b", None, 0.08, "a"),
        TableSpec("c R0.784", 0.784, None, "a"),
    )
    monkeypatch.setattr(family, "table_specs", lambda robot, quick: asked)
    monkeypatch.setattr(family, "continuation_stages", lambda own_m_s: (Stage(0.03, 30, 0.1, 1),))


@pytest.mark.slow
def test_an_interrupted_table_goes_on_and_has_the_same_bits(short_table, monkeypatch, tmp_path):
    whole = build_table(ROBOT, jobs=1)

    def interrupt(line):
        if line.startswith("b"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_table(ROBOT, say=interrupt, jobs=1, resume=tmp_path / "kept")
    fulfil, asked = family._fulfil, []
    monkeypatch.setattr(
        family, "_fulfil", lambda work, task: asked.append(task.spec.name) or fulfil(work, task)
    )
    resumed = build_table(ROBOT, jobs=1, resume=tmp_path / "kept")
    assert asked == ["c R0.784"]
    assert resumed == whole
    assert len(whole.gaits) == 8
