"""Every command has a console script, and every console script is a command."""

from importlib import import_module
from pathlib import Path

import pytest

try:
    import tomllib
except ImportError:  # Python 3.10
    tomllib = None

ROOT = Path(__file__).resolve().parents[2]
# motion plays tables for developers, the tour is what `make run` runs
WITHOUT = {"planners.motion", "planners.tour"}


@pytest.mark.skipif(tomllib is None, reason="needs tomllib")
def test_scripts_are_the_commands():
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]
    commands = {
        ".".join(file.relative_to(ROOT).parts[:-1])
        for package in ("srs_opt", "planners")
        for file in (ROOT / package).rglob("__main__.py")
    }
    targets = {target.removesuffix(".__main__:main") for target in scripts.values()}
    assert targets == commands - WITHOUT
    assert all(name == "plan" or name.startswith("srs-") for name in scripts)
    for target in scripts.values():
        module, function = target.split(":")
        assert callable(getattr(import_module(module), function))
