"""The C source of a controller's program: constants for the player library in ``firmware/``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

from srs_opt.controller.program import Program
from srs_opt.errors import InputError
from srs_opt.files import write_text
from srs_opt.gait_opt.table import GaitTable
from srs_opt.gait_opt.ticks import WORD_BITS


def c_source(program: Program) -> str:
    """Return a C99 header that defines ``srs_program_data`` for ``srs_player_init``."""
    events: list[str] = []
    gaits: list[str] = []
    for gait in program.gaits:
        schedule = gait.schedule
        gaits.append(
            f"  {{{schedule.period}u, {len(events)}u, {len(schedule.events)}u, "
            f"{_pascal(gait.pressure_kpa)}u, {_milli(gait.speed_m_s)}, {_milli(gait.turn_rate_rad_s)}}}, "
            f"/* {len(gaits)}: {safe_text(gait.name)} */"
        )
        events += [
            f"  {{{tick}u, {{{', '.join(f'0x{w:08x}u' for w in _split(mask, program.words))}}}}},"
            for tick, mask in schedule.events
        ]
    limits = program.limits
    slew = 0 if limits.slew_kpa_s is None else max(1, round(limits.slew_kpa_s * 1e3 * program.tick_s))
    values = {
        "ROBOT": safe_text(program.robot),
        "ID": f"0x{program.identity:08x}",
        "TICK_US": f"{program.tick_s * 1e6:.0f}",
        "SEGMENTS": str(program.segments),
        "WORDS": str(program.words),
        "GAIT_COUNT": str(len(gaits)),
        "EVENT_COUNT": str(len(events)),
        "STEP_COUNT": str(len(program.steps)),
        "DWELL": str(program.ticks(limits.dwell_s)),
        "SETTLE": str(program.ticks(limits.settle_s)),
        "VENT": str(program.ticks(limits.vent_s)),
        "TIMEOUT": str(program.ticks(limits.timeout_s)),
        "MOST_PA": str(max(_pascal(g.pressure_kpa) for g in program.gaits)),
        "SLEW_PA": str(slew),
        "EVENTS": "\n".join(events),
        "GAITS": "\n".join(gaits),
        # C99 has no empty arrays: a program without a plan has one step that nobody reads
        "STEPS": "\n".join(f"  {{{gait}u, {cycles}u}}," for gait, cycles in program.steps or ((0, 1),)),
    }
    return _filled("program.h.in", values)


def write_program(program: Program, path: Path) -> Path:
    """Write the program's header."""
    return write_text(path, c_source(program))


def changes_source(program: Program, table: GaitTable) -> str:
    """Return a C99 header that defines ``srs_changes_data``: what a cycle of a gait does after another's.

    Raises
    ------
    InputError
        If the table does not say.
    """
    changes = table.changes
    if changes is None:
        raise InputError(f"the gait table of robot '{table.robot_name}' does not say what changes of gait do")
    befores = [
        f"  {{{{{', '.join(map(str, speeds))}}}, {course}}},"
        for speeds, course in zip(changes.speed.tolist(), changes.course.tolist())
    ]
    moves = [
        f"  {{{', '.join('{' + ','.join(map(str, level)) + '}' for level in levels)}}},"
        for row in changes.moved.tolist()
        for levels in row
    ]
    values = {
        "ROBOT": safe_text(program.robot),
        "ID": f"0x{program.identity:08x}",
        "GAIT_COUNT": str(len(program.gaits)),
        "ROWS": str(len(befores)),
        "PAIRS": str(len(moves)),
        "BEFORES": "\n".join(befores),
        "MOVES": "\n".join(moves),
    }
    return _filled("changes.h.in", values)


def write_changes(program: Program, table: GaitTable, path: Path) -> Path:
    """Write the header of a table's changes of gait; its id is that of the table's program."""
    return write_text(path, changes_source(program, table))


def _filled(name: str, values: Mapping[str, str]) -> str:
    template = resources.files("srs_opt.controller").joinpath(name).read_text(encoding="utf-8")
    return re.sub(r"@(\w+)@", lambda found: values[found[1]], template)


def safe_text(text: str) -> str:
    """Return a name as it may stand in C source: letters, digits, ``_``, space, ``.`` and ``-`` only."""
    return re.sub(r"[^A-Za-z0-9_ .-]", "_", text)


def _split(mask: int, words: int) -> list[int]:
    return [(mask >> (WORD_BITS * k)) & (2**WORD_BITS - 1) for k in range(words)]


def _pascal(pressure_kpa: float) -> int:
    return round(pressure_kpa * 1e3)


def _milli(value: float) -> int:
    # 16 bits in the firmware's tables
    return max(-32767, min(32767, round(value * 1e3)))
