import shutil

import pytest

from srs_opt.controller.c_source import write_program
from srs_opt.controller.program import Program
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.robot import wpi_srs

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


@pytest.fixture(scope="session")
def table():
    return default_table(wpi_srs(), driver=True)


@pytest.fixture(scope="session")
def program(table):
    return Program.of_table(table, 1e-3)


@pytest.fixture(scope="session")
def header(program, tmp_path_factory):
    return write_program(program, tmp_path_factory.mktemp("program") / "gait_table.h")
