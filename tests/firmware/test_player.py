"""The C player against the gaits it was generated from, its guards, and its build for three machines."""

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planners.pilot import protocol
from planners.pilot.protocol import Command, Fault, State
from srs_opt.controller.c_source import c_source, write_program
from srs_opt.controller.program import ControllerLimits, Program
from srs_opt.errors import InputError
from srs_opt.gait import Gait
from virtual_lab.controller import Controller

FIRMWARE = Path(__file__).parents[2] / "firmware"
SETTLE, VENT, TIMEOUT = 300, 700, 500  # ticks of the default limits
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


class Line:
    """The pilot's end of the line, without a clock: commands, and whatever was answered."""

    def __init__(self, controller):
        self.controller, self.receiver, self.seq = controller, protocol.Receiver(), 0
        self.heard = []

    def command(self, kind, payload=b""):
        self.seq = self.seq % 255 + 1
        self.controller.receive(protocol.frame(kind, self.seq, payload))
        return self.answer()

    def select(self, gait):
        return self.command(Command.SELECT, protocol.select_payload(gait, gait))

    def answer(self):
        new = self.receiver.feed(self.controller.send())
        self.heard += new
        return next((m for m in new if m.seq == self.seq), None)

    def ticks(self, count, every=100):
        """Play, asking for the state now and then so that no timeout strikes; return states, pressures."""
        states, pressures = [], []
        for k in range(count):
            if every and k % every == 0:
                self.command(Command.QUERY)
            state, pressure = self.controller.tick()
            states.append(state)
            pressures.append(pressure)
        self.answer()
        return np.array(states), np.array(pressures)


def two_gaits():
    """Return two gaits of two segments, 100 and 80 ticks long, that share no switch."""
    slow = Gait(0.1, 40.0, (((0.0, 0.05),), ((0.03, 0.08),)))
    quick = Gait(0.08, 50.0, (((0.02, 0.06),), ((0.0, 0.04),)))
    return [("slow", slow, 0.1, 0.0), ("quick", quick, 0.2, 0.1)]


def flashed(tmp_path, cycles=(), **limits):
    program = Program.of_cycles("test", cycles, two_gaits(), 1e-3, ControllerLimits(**limits))
    if not cycles:
        program = replace(program, steps=())
    return Line(Controller(write_program(program, tmp_path / "program.h")))


def test_every_gait_of_the_table_is_played_as_it_is_defined(table, tmp_path):
    # a cycle's first tick may be the middle of a pulse: without the guard it is played as it stands
    program = Program.of_table(table, 1e-3, ControllerLimits(dwell_s=0.0))
    line = Line(Controller(write_program(program, tmp_path / "gait_table.h")))
    assert not line.ticks(5)[0].any()  # vented from boot
    for index in range(0, len(table.gaits), 7):
        gait = table.gaits[index].gait
        period = round(gait.period_s / 1e-3)
        assert line.select(index).result is Fault.OK
        settling, pressure = line.ticks(SETTLE)
        assert not settling.any() and pressure[-1] == pytest.approx(gait.pressure_kpa, abs=1e-3)
        played, pressure = line.ticks(2 * period + 17)
        wanted = np.array([gait.valve((k + 0.5) * 1e-3 % gait.period_s) for k in range(len(played))])
        np.testing.assert_array_equal(played, wanted)
        line.command(Command.VENT)
        vented, pressure = line.ticks(VENT + 1)
        assert not vented.any() and not pressure.any()


def test_a_gait_changes_only_where_the_cycle_ends(tmp_path):
    line = flashed(tmp_path)
    line.select(0)
    line.ticks(SETTLE + 30)
    assert line.select(1).pending == 1
    (_, slow, *_), (_, quick, *_) = two_gaits()
    played, pressure = line.ticks(70 + 80)
    wanted = [slow.valve((k + 0.5) * 1e-3) for k in range(30, 100)]
    wanted += [quick.valve((k + 0.5) * 1e-3) for k in range(80)]
    np.testing.assert_array_equal(played, wanted)
    assert set(pressure[:70]) == {40.0} and set(pressure[70:]) == {50.0}


def test_a_single_cycle_is_followed_by_venting_unless_a_word_comes_in_time(tmp_path):
    line = flashed(tmp_path)
    line.command(Command.SELECT, protocol.select_payload(0, None))
    line.ticks(SETTLE + 60)
    line.command(Command.SELECT, protocol.select_payload(1, None))
    played, _ = line.ticks(40 + 80 + 50)
    assert played[:120].any(axis=1).all() and not played[120:].any()


def test_a_plan_runs_by_itself_and_vents_at_its_end(tmp_path):
    line = flashed(tmp_path, cycles=[0, 0, 1, 0])
    assert line.command(Command.RUN).result is Fault.OK
    assert not line.ticks(SETTLE, every=0)[0].any()
    played, _ = line.ticks(100 + 100 + 80 + 100, every=0)  # no pilot: the timeout does not apply
    (_, slow, *_), (_, quick, *_) = two_gaits()
    wanted = [
        g.valve((k + 0.5) * 1e-3) for g in (slow, slow, quick, slow) for k in range(round(g.period_s * 1e3))
    ]
    np.testing.assert_array_equal(played, wanted)
    assert not line.ticks(VENT + 5, every=0)[0].any()
    assert line.command(Command.QUERY).state is State.VENTED
    assert line.command(Command.RUN).result is Fault.OK  # and again


def test_silence_vents_at_the_next_tick(tmp_path):
    line = flashed(tmp_path)
    line.select(0)
    played, _ = line.ticks(TIMEOUT + 50, every=0)
    assert played[SETTLE:TIMEOUT].any(axis=1).all()
    assert not played[TIMEOUT:].any()
    assert line.command(Command.QUERY).fault is Fault.TIMEOUT
    assert line.select(0).result is Fault.REFUSED_BUSY  # the body is not straight yet
    line.ticks(VENT)
    assert line.select(0).result is Fault.OK


def test_dwell_is_kept_whatever_is_asked_for(tmp_path):
    line = flashed(tmp_path, dwell_s=0.035)
    line.select(0)
    line.ticks(SETTLE + 90)
    line.select(1)
    played, _ = line.ticks(400)
    for segment in played.T:
        changes = np.flatnonzero(np.diff(segment)) + 1
        assert np.diff(changes).min() >= 35
    assert line.command(Command.QUERY).fault is Fault.DWELL


def test_a_sent_cycle_is_played_once(tmp_path):
    line = flashed(tmp_path)
    line.select(0)
    line.ticks(SETTLE + 50)
    events = [(0, 0b0110), (25, 0b1001), (45, 0b0101)]
    status = line.command(Command.CYCLE, protocol.cycle_payload(1, 70, 45_000, events, 1))
    assert status.result is Fault.OK and status.has_pending and status.pending is None
    played, pressure = line.ticks(50 + 70 + 80)
    joining = played[50:120]
    np.testing.assert_array_equal(joining[:25], np.tile([-1, 1], (25, 1)))
    np.testing.assert_array_equal(joining[25:45], np.tile([1, -1], (20, 1)))
    np.testing.assert_array_equal(joining[45:], np.tile([1, 1], (25, 1)))
    assert set(pressure[50:120]) == {45.0}
    quick = two_gaits()[1][1]
    np.testing.assert_array_equal(played[120:], [quick.valve((k + 0.5) * 1e-3) for k in range(80)])


@pytest.mark.parametrize(
    ("period", "pressure", "events"),
    [
        (60, 45_000, [(0, 0b0011)]),  # both valves of segment 1
        (60, 45_000, [(0, 1 << 4)]),  # a segment that is not there
        (60, 45_000, [(5, 1)]),  # nothing at tick 0
        (60, 45_000, [(0, 1), (20, 2), (20, 1)]),
        (60, 45_000, [(0, 1), (60, 2)]),
        (60, 51_000, [(0, 1)]),  # more than any gait of the program
        (0, 45_000, [(0, 1)]),
        (60, 45_000, []),
    ],
)
def test_a_cycle_that_cannot_be_played_is_refused_and_changes_nothing(tmp_path, period, pressure, events):
    line = flashed(tmp_path)
    line.select(0)
    line.ticks(SETTLE + 50)
    status = line.command(Command.CYCLE, protocol.cycle_payload(1, period, pressure, events, 1))
    assert status.result is Fault.REFUSED_CYCLE
    slow = two_gaits()[0][1]
    played, _ = line.ticks(150)
    np.testing.assert_array_equal(played, [slow.valve((k + 50.5) * 1e-3 % 0.1) for k in range(150)])


def test_both_valves_are_never_open_even_when_memory_fails(tmp_path):
    line = flashed(tmp_path)
    line.select(0)
    line.ticks(SETTLE + 10)
    line.controller.corrupt(0b0011)
    played, _ = line.ticks(20)
    assert not played.any()
    assert line.command(Command.QUERY).fault is Fault.BOTH_VALVES


def test_unknown_gaits_plans_and_messages_are_refused(tmp_path):
    line = flashed(tmp_path)
    assert line.select(2).result is Fault.REFUSED_GAIT
    assert line.command(Command.RUN).result is Fault.REFUSED_PLAN
    assert line.command(99).result is Fault.REFUSED_MESSAGE
    assert line.command(Command.SELECT, b"\0").result is Fault.REFUSED_MESSAGE
    assert not line.ticks(10)[0].any()


@pytest.mark.parametrize(
    ("pattern", "broken"),
    [
        (r"\{(\d+)u, 0u, (\d+)u,", r"{\1u, 9999u, \2u,"),  # events beyond the end
        (r"\{0u, \{0x0000000[0-9a-f]u\}\}", "{0u, {0x00000003u}}"),  # both valves
        (r"\{0u, \{", "{1u, {"),  # nothing at tick 0
        (r"\{(\d+)u, (\d+)u\},", r"{77u, 1u},"),  # a step's gait
        (r"\.segments = 2u", ".segments = 17u"),
    ],
)
def test_a_program_that_is_not_valid_is_never_played(tmp_path, pattern, broken):
    program = Program.of_cycles("test", [0, 1], two_gaits(), 1e-3)
    path = write_program(program, tmp_path / "program.h")
    text, count = re.subn(pattern, broken, path.read_text(), count=1)
    assert count == 1
    path.write_text(text)
    line = Line(Controller(path))
    assert line.command(Command.PING).fault is Fault.PROGRAM
    assert line.select(0).result is Fault.PROGRAM
    assert line.command(Command.RUN).result is Fault.PROGRAM
    assert not line.ticks(SETTLE + 200)[0].any()


def test_names_reach_the_source_as_plain_text():
    gait = two_gaits()[0][1]
    evil = '*/ int evil(void) { return 1; } /* "\\\n#include </etc/passwd> ??/'
    source = c_source(Program.of_cycles(evil, [0], [(evil, gait, 0.1, 0.0)], 1e-3))
    assert "evil(" not in source and "#include <" not in source and "??" not in source
    comments = re.findall(r"/\*.*?\*/", source, re.DOTALL)
    outside = re.sub(r"/\*.*?\*/", "", source, flags=re.DOTALL)
    assert sum("evil" in c for c in comments) == 2 and "evil" not in outside


def test_gaits_off_the_tick_grid_and_too_long_are_refused_in_one_line():
    entries = two_gaits()
    with pytest.raises(InputError, match=r"gait 'slow': .*not a whole number of ticks of 0.007 s"):
        Program.of_cycles("test", [0], entries, 0.007)
    with pytest.raises(InputError, match="choose a longer tick"):
        Program.of_cycles("test", [0], [("long", Gait(70.0, 40.0, (((0.0, 35.0),),)), 0.1, 0.0)], 1e-3)


@pytest.mark.parametrize("words", [1, 2, 4])
@pytest.mark.parametrize(
    "compiler",
    [
        "cc -Wall -Wextra -Werror -Wconversion -pedantic -Wshadow -Wcast-qual",
        "arm-none-eabi-gcc -mcpu=cortex-m0plus -mthumb -ffreestanding -Wall -Wextra -Werror",
        "avr-gcc -mmcu=atmega2560 -Wall -Wextra -Werror",
    ],
)
def test_the_library_compiles_without_a_warning(tmp_path, compiler, words):
    if shutil.which(compiler.split()[0]) is None:
        pytest.skip(f"{compiler.split()[0]} is not on this machine")
    main = tmp_path / "main.c"
    entries = [(name, _widened(gait, 16 * (words - 1)), v, w) for name, gait, v, w in two_gaits()]
    write_program(Program.of_cycles("test", [0, 1], entries, 1e-3), tmp_path / "program.h")
    main.write_text('#include "program.h"\nconst srs_program *used(void) { return &srs_program_data; }\n')
    sources = [FIRMWARE / f"srs_{name}.c" for name in ("player", "link", "changes")]
    for source in (*sources, main):
        flags = ["-std=c99", "-Os", f"-DSRS_WORDS={words}", f"-I{FIRMWARE}", "-c", str(source)]
        done = subprocess.run(
            [*compiler.split(), *flags, "-o", str(tmp_path / "out.o")], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr


def _widened(gait, more):
    return replace(gait, intervals=gait.intervals + gait.intervals[:1] * more)


def test_more_than_sixteen_segments_are_played(tmp_path):
    entries = [(name, _widened(gait, 21), v, w) for name, gait, v, w in two_gaits()]
    program = Program.of_cycles("long", [0, 1], entries, 1e-3)
    line = Line(Controller(write_program(program, tmp_path / "program.h"), words=2))
    line.command(Command.RUN)
    line.ticks(SETTLE, every=0)
    played, _ = line.ticks(180, every=0)
    wanted = [g.valve((k + 0.5) * 1e-3) for _, g, *_ in entries for k in range(round(g.period_s * 1e3))]
    np.testing.assert_array_equal(played, wanted)


def test_the_player_is_small_and_takes_nothing_from_the_system():
    player = [FIRMWARE / "srs_player.c", FIRMWARE / "srs_player.h"]
    assert sum(len(path.read_text().splitlines()) for path in player) < 600
    for path in FIRMWARE.glob("srs_*.[ch]"):
        text = path.read_text()
        includes = set(re.findall(r"#include [<\"](.*?)[>\"]", text))
        assert includes <= {
            "stdint.h",
            "string.h",
            "avr/pgmspace.h",
            "srs_player.h",
            "srs_link.h",
            "srs_changes.h",
        }
        assert not re.search(r"\b(malloc|free|printf|goto|float|double)\b", text)
