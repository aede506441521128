"""The commands where things go wrong around them: disks, folders, locales, compilers, displays, Ctrl-C."""

import contextlib
import json
import math
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MAP = [
    "srs_opt.gait_map",
    "--frequency",
    "1",
    "2",
    "2",
    "--pressure",
    "41",
    "55",
    "2",
    "--offset",
    "0",
    "--jobs",
    "1",
]
SIMULATE = ["srs_opt.simulate", "--duration", "1"]
GENERATE = ["planners.generate", "--seed", "1"]


def command(arguments: list[str], *more: object, **environment: str) -> tuple[list[str], dict[str, object]]:
    line = [sys.executable, "-m", *arguments, *map(str, more)]
    return line, {"cwd": ROOT, "env": {**os.environ, "OMP_NUM_THREADS": "1", **environment}, "text": True}


def run(arguments: list[str], *more: object, **environment: str) -> subprocess.CompletedProcess:
    line, options = command(arguments, *more, **environment)
    return subprocess.run(line, capture_output=True, timeout=300, check=False, **options)


def children_s() -> float:
    """Return the processor time of the processes that have ended: a busy machine does not add to it."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def one_line(done: subprocess.CompletedProcess) -> str:
    lines = [x for x in done.stderr.strip().splitlines() if not x.startswith("note:")]
    assert len(lines) == 1, done.stderr
    assert "Traceback" not in done.stderr
    return lines[0]


def left_behind(folder: Path) -> list[Path]:
    return [p for p in folder.rglob("*") if p.name.startswith(".partial-")]


@pytest.mark.parametrize("arguments", [SIMULATE, MAP, GENERATE], ids=lambda a: a[0])
def test_out_is_a_file(arguments, tmp_path):
    (tmp_path / "taken").write_text("")
    done = run(arguments, "--out", tmp_path / "taken", "--quiet")
    assert done.returncode == 2
    assert "taken" in one_line(done)
    assert "--out" in one_line(done)


@pytest.mark.parametrize(
    "arguments",
    [["srs_opt.gait_opt"], ["planners.plan", "mazes/first.yaml"], ["srs_opt.calibrate", "nowhere"]],
    ids=lambda a: a[0],
)
def test_out_is_a_file_is_said_before_the_work(arguments, tmp_path):
    (tmp_path / "taken.txt").write_text("mine")
    began = children_s()
    done = run(arguments, "--out", tmp_path / "taken.txt")
    assert done.returncode == 2
    assert "taken.txt: cannot write" in one_line(done)
    assert children_s() - began < 20
    assert (tmp_path / "taken.txt").read_text() == "mine"


@pytest.mark.skipif(not Path("/proc/version").exists(), reason="no folder that even root may not write to")
@pytest.mark.parametrize(
    "arguments", [SIMULATE, ["srs_opt.gait_opt"], ["planners.plan", "mazes/first.yaml"]], ids=lambda a: a[0]
)
def test_read_only_folder(arguments):
    """Said at once, not after minutes of work."""
    began = children_s()
    done = run(arguments, "--out", "/proc/srs", "--quiet")
    assert done.returncode == 2
    assert "cannot write" in one_line(done)
    assert children_s() - began < 20


def test_disk_full(tmp_path):
    """Files may not grow beyond a kilobyte, like on a full disk: told in a line, no incomplete file."""
    line, options = command(SIMULATE, "--out", tmp_path, "--quiet")

    def small_files() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))

    done = subprocess.run(
        line, preexec_fn=small_files, capture_output=True, timeout=300, check=False, **options
    )
    assert done.returncode == 2
    assert "cannot write" in one_line(done)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_output_to_a_full_disk(tmp_path):
    line, options = command(GENERATE, "--json", "--out", tmp_path)
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(line, stdout=full, stderr=subprocess.PIPE, timeout=100, check=False, **options)
    assert done.returncode == 2
    assert "No space left" in one_line(done)


def test_reader_of_the_output_goes_away(tmp_path):
    line, options = command(GENERATE, "--json", "--out", tmp_path)
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(line, stdout=writing, stderr=subprocess.PIPE, timeout=100, check=False, **options)
    os.close(writing)
    assert done.returncode == 141
    assert not done.stderr


@pytest.mark.parametrize("arguments", [["virtual_lab", "--list"], SIMULATE], ids=lambda a: a[0])
def test_reader_goes_away_or_was_never_there(arguments, tmp_path):
    line, options = command(arguments, "--out", tmp_path / "out")
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(line, stdout=writing, stderr=subprocess.PIPE, timeout=100, check=False, **options)
    os.close(writing)
    assert (done.returncode, done.stderr) == (141, "")
    shell = ["bash", "-c", '"$@" >&-', "bash", *line]
    done = subprocess.run(shell, stderr=subprocess.PIPE, timeout=100, check=False, **options)
    assert (done.returncode, done.stderr) == (0, "")


def test_names_that_the_terminal_cannot_show(tmp_path):
    robot = tmp_path / "robot.yaml"
    robot.write_text("name: Schlange Ü ± 蛇\n", encoding="utf-8")
    where = tmp_path / "蛇"
    done = run(SIMULATE, "--robot", robot, "--out", where, PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    assert "\\u86c7" in done.stdout


def test_no_compiler(tmp_path):
    """Without a C compiler, and without a cache, the interpreter gives the same numbers."""
    answers = []
    for name, compiler in (("with", ""), ("without", "none")):
        done = run(SIMULATE, "--json", "--out", tmp_path / name, SRS_OPT_CC=compiler)
        assert done.returncode == 0, done.stderr
        answers.append(json.loads(done.stdout))
        if compiler:
            assert "no C compiler" in done.stderr
    assert answers[1]["compile_s"] == 0
    assert answers[0]["speed_m_s"] == pytest.approx(answers[1]["speed_m_s"], rel=1e-6)


def test_cache_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    done = run(SIMULATE, "--json", "--out", tmp_path / "out", SRS_OPT_CACHE=str(tmp_path / "file"))
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["speed_m_s"] is not None
    assert "Traceback" not in done.stderr


def test_no_display_and_odd_matplotlib(tmp_path):
    without = dict.fromkeys(("DISPLAY", "WAYLAND_DISPLAY"), "")
    done = run(SIMULATE, "--out", tmp_path, "--quiet", MPLBACKEND="TkAgg", **without)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "trajectory.png").stat().st_size > 10_000


@pytest.mark.parametrize("locale", ["C", "POSIX", "de_DE.UTF-8", "tr_TR.UTF-8"])
def test_other_locales(locale, tmp_path):
    folder = tmp_path / "Mäander und Löcher"
    done = run(SIMULATE, "--out", folder, LC_ALL=locale, LANG=locale, PYTHONUTF8="0", PYTHONCOERCECLOCALE="0")
    assert done.returncode == 0, done.stderr
    first = (folder / "trajectory.csv").read_text(encoding="utf-8").splitlines()[1]
    assert all(float(cell) is not None for cell in first.split(","))


def test_spaces_and_windows_line_ends(tmp_path):
    folder = tmp_path / "my robot files"
    folder.mkdir()
    robot = folder / "my robot.yaml"
    robot.write_bytes(
        "\ufeffname: mine\r\nlinks: 5\r\neffects:\r\n  - {name: head_mass, extra_kg: 0.01}\r\n".encode()
    )
    schedule = folder / "my gait.csv"
    rows = [f"{i},{0.1 * i:.1f},{0.1 * i + 0.2:.1f},0.8" for i in range(1, 5)]
    schedule.write_bytes("\r\n".join(["segment,on_s,off_s,period_s", *rows, ""]).encode())
    done = run(SIMULATE, "--robot", robot, "--gait", schedule, "--out", folder / "out put", "--json")
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 1
    assert isinstance(json.loads(done.stdout), dict)


LONG = {
    "simulate": ["srs_opt.simulate", "--duration", "20000"],
    "gait_map": [
        "srs_opt.gait_map",
        "--frequency",
        "1",
        "2",
        "300",
        "--pressure",
        "41",
        "55",
        "50",
        "--jobs",
        "2",
    ],
}


def session_s(leader: int) -> float:
    """Return the processor time that a session's processes have had: how far they are, however busy it is.

    Where the system does not say, infinite after some seconds.
    """
    found = 0.0
    for file in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # a process that has just ended
            fields = file.read_text().rpartition(")")[2].split()
            found += (int(fields[11]) + int(fields[12])) * (int(fields[3]) == leader)
    if not Path("/proc/self/stat").exists():
        time.sleep(8.0)
        return math.inf
    return found / os.sysconf("SC_CLK_TCK")


def interrupt(arguments: list[str], folder: Path, after_s: float) -> subprocess.CompletedProcess:
    """Run a command in a session of its own and send it what a terminal's Ctrl-C sends: SIGINT to all.

    Not before its processes have had `after_s` of processor time.
    """
    line, options = command(arguments, "--out", folder)
    running = subprocess.Popen(
        line,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        # whoever runs the tests in the background has switched Ctrl-C off, and children inherit that
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        **options,
    )
    end = time.monotonic() + 20 * after_s
    while session_s(running.pid) < after_s and time.monotonic() < end and running.poll() is None:
        time.sleep(0.05)
    assert running.poll() is None, "it ended before it could be interrupted"
    os.killpg(running.pid, signal.SIGINT)
    try:
        out, err = running.communicate(timeout=60)
    except subprocess.TimeoutExpired:
        os.killpg(running.pid, signal.SIGKILL)  # a failure here must not disturb the tests that follow
        running.communicate()
        raise
    return subprocess.CompletedProcess(line, running.returncode, out, err)


@pytest.mark.parametrize("name", LONG)
def test_ctrl_c_leaves_nothing_half_written(name, tmp_path):
    done = interrupt(LONG[name], tmp_path, 2.5)
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr
    assert "interrupted" in done.stderr
    assert not done.stdout
    assert not left_behind(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gait_opt", "table", "discrepancy"])
def test_ctrl_c_in_long_work(name, tmp_path):
    """Work in several processes ends as one; gait_opt may answer with the best gait so far."""
    arguments = ["srs_opt.gait_opt", "--starts", "200"]
    if name == "table":
        arguments = ["srs_opt.gait_opt", "--table", "--model", "complex", "--jobs", "2"]
    if name == "discrepancy":
        run(["virtual_lab", "--effect", "stribeck", "--quiet", "--out", str(tmp_path / "set")])
        arguments = ["srs_opt.discrepancy", str(tmp_path / "set"), "--jobs", "2"]
    done = interrupt(arguments, tmp_path / "out", 8.0 if name == "table" else 5.0)  # workers start up too
    assert done.returncode in ((0, 1, 130) if name == "gait_opt" else (130,)), done.stderr
    assert "Traceback" not in done.stderr
    assert not left_behind(tmp_path)
    if name == "table":
        assert "goes on from there" in done.stderr
        assert not list(tmp_path.rglob("gait_table*"))


@pytest.mark.parametrize("arguments", [SIMULATE, MAP, GENERATE], ids=lambda a: a[0])
def test_json_is_one_object(arguments, tmp_path):
    done = run(arguments, "--json", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.strip().splitlines()) == 1
    assert isinstance(json.loads(done.stdout), dict)


@pytest.mark.parametrize("module", ["srs_opt.gait_opt", "planners.plan"])
def test_a_missing_package_is_one_line(module, tmp_path):
    """A Python without the dependencies, as in a shell where nobody activated the environment."""
    done = subprocess.run(
        [sys.executable, "-S", "-m", module, *(["x.yaml"] if module == "planners.plan" else [])],
        capture_output=True, text=True, check=False, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert sys.executable in done.stderr
    assert ". .venv/bin/activate" in done.stderr
    assert "Traceback" not in done.stderr
    assert "no package '" in done.stderr
