"""The page of file formats names every key and column that the code reads, and every effect."""

import json
from pathlib import Path

import pytest

from planners.maze.load import ENDINGS
from srs_opt.effects import known_effects
from srs_opt.gait_map.grid import COLUMNS
from srs_opt.measurement import bench_files, read

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")


def keys(schema: object) -> set[str]:
    """Return all property names of a schema, at any depth."""
    found: set[str] = set()
    if isinstance(schema, dict):
        properties = schema.get("properties")
        if isinstance(properties, dict):
            found |= set(properties)
        for value in schema.values():
            found |= keys(value)
    elif isinstance(schema, list):
        for value in schema:
            found |= keys(value)
    return found


SCHEMAS = sorted([*(ROOT / "srs_opt").rglob("*.schema.json"), *(ROOT / "planners").rglob("*.schema.json")])


@pytest.mark.parametrize("path", SCHEMAS, ids=lambda p: p.name)
def test_every_key_is_documented(path):
    schema = json.loads(path.read_text(encoding="utf-8"))
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    missing = {key for key in keys(schema) if key not in PAGE}
    assert not missing - {"bounds", "rings", "cells", "start", "goal", "outcome", "png", "size"}


@pytest.mark.parametrize(
    "columns",
    [COLUMNS, read.TRIAL_COLUMNS, read.SCHEDULE_COLUMNS, bench_files.MAP_COLUMNS, bench_files.STEP_COLUMNS,
     bench_files.SPRING_CAR_COLUMNS, bench_files.TOW_COLUMNS, bench_files.CHECK_COLUMNS],
    ids=lambda columns: columns[-1],
)  # fmt: skip
def test_every_column_is_documented(columns):
    assert not [column for column in columns if column not in PAGE]


def test_every_effect_is_documented():
    for effect in known_effects().values():
        row = next((line for line in PAGE.splitlines() if line.startswith(f"| `{effect.name}`")), None)
        assert row is not None, effect.name
        assert [p.name for p in effect.parameters if f"`{p.name}`" not in row] == []


def test_every_key_of_a_plan_is_documented(tmp_path):
    from planners.plan.__main__ import main as plan

    for maze, status in (("u_turn", 0), ("no_way", 1)):
        folder = tmp_path / maze
        given = [str(ROOT / f"mazes/{maze}.yaml"), "--execute", "--quiet", "--out", str(folder)]
        assert plan(given) == status
        record = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
        names = {*record, *record.get("execution", {}), *(record.get("tightest") or {})}
        names |= {key for row in (*record["steps"][:1], *record["path"][:1]) for key in row}
        assert not {name for name in names if f"`{name}`" not in PAGE}


def test_every_command_is_listed():
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    folders = [
        path.parent for package in ("srs_opt", "planners") for path in (ROOT / package).rglob("__main__.py")
    ]
    names = [".".join(folder.relative_to(ROOT).parts) for folder in folders]
    assert not [name for name in names if f"python -m {name}" not in page and name != "planners.plan"]


def test_every_maze_ending_is_documented():
    assert not [ending for ending in ENDINGS if ending != ".json" and ending not in PAGE and ending != ".yml"]
