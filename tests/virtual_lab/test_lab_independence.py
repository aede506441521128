"""The laboratory and the models under test share no code."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def imported(folder: str) -> set[str]:
    found = set()
    for path in (ROOT / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                found.add(node.module.split(".")[0])
    return found


def test_laboratory_imports_no_model():
    assert imported("virtual_lab")
    assert not imported("virtual_lab") & {"srs_opt", "planners", "casadi"}


@pytest.mark.parametrize("package", ["srs_opt", "planners"])
def test_package_does_not_import_the_laboratory(package):
    assert imported(package)
    assert "virtual_lab" not in imported(package)


def test_running_it_loads_no_model():
    code = "import sys, virtual_lab.dataset; print(*(m.split('.')[0] for m in sys.modules))"
    out = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert not set(out.split()) & {"srs_opt", "planners", "casadi"}


def test_it_is_not_in_the_wheel():
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    line = next(line for line in text.splitlines() if line.startswith("include = "))
    assert "virtual_lab" not in line
