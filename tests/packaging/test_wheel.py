"""Wheel and sdist hold what they must, and install and run in a clean environment on every Python here."""

import email
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PYTHONS = ("3.10", "3.11", "3.12", "3.13")
DATA = {".yaml", ".json", ".jinja", ".in", ".typed", ".csv", ".npz"}
NOT_SHIPPED = ("tests/", "virtual_lab/", "examples/", "benchmarks/", "docs/", "out/")


def run(*command: object, cwd: Path | None = None, timeout: float = 500) -> str:
    """Run a command outside the project's folder and environment; return its stdout."""
    hidden = ("PYTHONPATH", "VIRTUAL_ENV", "PYTHONHOME")
    environment = {k: v for k, v in os.environ.items() if k not in hidden}
    done = subprocess.run(
        [str(c) for c in command], cwd=cwd, env=environment, capture_output=True, text=True, timeout=timeout
    )
    assert done.returncode == 0, f"{command}: {done.stdout[-2000:]}{done.stderr[-2000:]}"
    return done.stdout


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    """A copy of what git would hand to a stranger (no leftovers of earlier builds)."""
    copy = tmp_path_factory.mktemp("source")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    for package in ("srs_opt", "planners", "dart_snake"):
        shutil.copytree(ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


@pytest.fixture(scope="module")
def built(source, tmp_path_factory) -> tuple[Path, Path]:
    """Build sdist, then the wheel from the sdist: (sdist, wheel)."""
    out = tmp_path_factory.mktemp("dist")
    pytest.importorskip("build", reason="the package 'build' is not installed (extra dev)")
    run(sys.executable, "-m", "build", "--outdir", out, source, timeout=300)
    (sdist,) = out.glob("*.tar.gz")
    (wheel,) = out.glob("*.whl")
    return sdist, wheel


def package_files(source: Path, suffixes: set[str]) -> set[str]:
    return {
        path.relative_to(source).as_posix()
        for package in ("srs_opt", "planners", "dart_snake")
        for path in (source / package).rglob("*")
        if path.suffix in suffixes and path.is_file()
    }


@pytest.mark.slow
def test_archives_hold_code_and_data_and_nothing_else(source, built):
    sdist, wheel = built
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        metadata = next(n for n in names if n.endswith("METADATA"))
        header = email.message_from_bytes(archive.read(metadata))
    with tarfile.open(sdist) as archive:
        in_sdist = {name.partition("/")[2] for name in archive.getnames()}
    wanted = package_files(source, DATA | {".py"})
    assert not wanted - names
    assert not wanted - in_sdist
    assert not [n for n in names | in_sdist if n.startswith(NOT_SHIPPED)]
    assert header["License-Expression"] == "MIT"
    assert header["Requires-Python"] == ">=3.10"
    assert "README" not in (header["Summary"] or "README")
    assert header.get_payload().strip()


def find_python(version: str) -> str | None:
    """Return an interpreter of that version from PATH or from pyenv's folder, if there is one."""
    if sys.version_info[:2] == tuple(map(int, version.split("."))):
        return sys.executable
    pyenv = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv") / "versions"
    candidates = [*pyenv.glob(f"{version}.*/bin/python"), shutil.which(f"python{version}")]
    for candidate in filter(None, candidates):
        done = subprocess.run(
            [str(candidate), "-c", "import sys, venv, ensurepip; print('%d.%d' % sys.version_info[:2])"],
            capture_output=True,
            text=True,
        )
        if done.returncode == 0 and done.stdout.strip() == version:
            return str(candidate)
    return None


CHECK = """
import json, sys
import srs_opt, planners
from importlib.metadata import entry_points, version
from pathlib import Path
from srs_opt.gait import published_wave
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs
robot = wpi_srs()
orbit = steady_gait(robot, published_wave(robot).gait())
plan = next(e for e in entry_points(group="console_scripts") if e.name == "plan")
plan.load()
print(json.dumps({"speed": orbit.speed_m_s, "file": srs_opt.__file__, "version": version("srs-opt"),
                  "same": srs_opt.__version__}))
"""


@pytest.mark.slow
@pytest.mark.parametrize("version", PYTHONS)
def test_installs_and_runs_in_a_clean_environment(version, built, tmp_path):
    python = find_python(version)
    if python is None:
        pytest.skip(f"no Python {version} on this machine (looked on PATH and in pyenv)")
    sdist, wheel = built
    run(python, "-m", "venv", "--without-pip", tmp_path / "venv")
    clean = tmp_path / "venv" / ("Scripts" if os.name == "nt" else "bin")
    package = sdist if version == PYTHONS[0] else wheel
    pip = (sys.executable, "-m", "pip", "--python", clean / "python")
    options = ["--quiet", "--no-compile", "-c", ROOT / "constraints.txt"]
    if python == sys.executable:  # what it depends on is here already, and the other versions install it
        (folder,) = (tmp_path / "venv").rglob("site-packages")
        (folder / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
        options.append("--no-deps")
    run(*pip, "install", *options, package)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    answer = json.loads(run(clean / "python", "-c", CHECK, cwd=elsewhere))
    assert answer["speed"] == pytest.approx(0.2315, rel=2e-3)
    assert str(tmp_path) in answer["file"]
    assert answer["version"] == answer["same"]
    assert "MAZE" in run(clean / "plan", "--help", cwd=elsewhere)
