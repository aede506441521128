"""Nobody waits for a help text: every command's --help and the import, best of a few on a busy machine."""

import pytest

from benchmarks.startup import HELP_S, IMPORT_S, commands, help_seconds, import_seconds


def test_all_commands_are_found():
    assert {"planners.plan", "srs_opt.simulate", "srs_opt.gait_map", "srs_opt.gait_opt"} <= set(commands())


@pytest.mark.parametrize("command", commands())
def test_help_is_quick(command):
    assert help_seconds(command, enough_s=HELP_S, tries=6) < HELP_S


def test_import_is_quick():
    assert import_seconds(enough_s=IMPORT_S, tries=6) < IMPORT_S
