"""A signal that comes at the wrong moment: while a process starts, or in foreign code that swallows it."""

import os
import signal
import subprocess
import tempfile
import time
from contextlib import contextmanager

import pytest

from srs_opt.files import atomic_path, temporary_folder
from srs_opt.interrupts import signals_deferred, signals_not_lost
from srs_opt.simulate import compiled

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")


class Ended(BaseException):
    pass


@contextmanager
def handled(number):
    def end(number, frame):
        raise Ended

    before = signal.signal(number, end)
    try:
        yield
    finally:
        signal.signal(number, before)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_deferred_to_the_end_of_the_block(number):
    reached = []

    def work():
        with signals_deferred():
            os.kill(os.getpid(), number)
            time.sleep(0.01)
            reached.append("the end of the block")
        reached.append("what follows")

    with handled(number), pytest.raises(Ended):
        work()
    assert reached == ["the end of the block"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("other", [None, ValueError])
def test_what_foreign_code_swallows_is_raised_again(number, other):
    def work():
        with signals_not_lost():
            try:
                os.kill(os.getpid(), number)
                time.sleep(1)
            except Ended:
                if other is not None:
                    raise other from None
        raise AssertionError("went on")

    with handled(number), pytest.raises(Ended):
        work()


@pytest.mark.parametrize("name", ["mkdtemp", "mkstemp"])
def test_nothing_temporary_is_left(name, monkeypatch, tmp_path):
    """SIGTERM comes after the folder or file exists and before anybody knows its name."""
    make = getattr(tempfile, name)

    def slow(*args, **options):
        made = make(*args, **options)
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.01)
        return made

    monkeypatch.setattr(tempfile, name, slow)
    work = temporary_folder(tmp_path) if name == "mkdtemp" else atomic_path(tmp_path / "answer.json")
    with handled(signal.SIGTERM), pytest.raises(Ended), work:
        raise AssertionError("went on")
    assert not list(tmp_path.iterdir())


def test_a_compiler_that_is_starting_does_not_outlive_us(monkeypatch):
    """SIGTERM comes after the process exists and before anybody knows its number."""
    started = []

    class Slow(subprocess.Popen):
        def __init__(self, *args, **options):
            super().__init__(*args, **options)
            started.append(self)
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.01)

    monkeypatch.setattr(subprocess, "Popen", Slow)
    with handled(signal.SIGTERM), pytest.raises(Ended):
        compiled._run(["sleep", "60"], timeout_s=60)
    assert [process.returncode for process in started] == [-signal.SIGKILL]
