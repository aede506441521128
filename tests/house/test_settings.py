"""Tuned values stand in frozen settings: each class has its own name and says what every value is for."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = [path for package in ("srs_opt", "planners") for path in sorted((ROOT / package).rglob("*.py"))]


def _settings() -> list[ast.ClassDef]:
    texts = (path.read_text(encoding="utf-8") for path in FILES)
    nodes = (node for text in texts if "Settings" in text for node in ast.parse(text).body)
    return [node for node in nodes if isinstance(node, ast.ClassDef) and node.name.endswith("Settings")]


SETTINGS = _settings()


def test_every_settings_class_has_a_name_of_its_own():
    names = [node.name for node in SETTINGS]
    assert sorted(names) == sorted(set(names))


@pytest.mark.parametrize("node", SETTINGS, ids=[node.name for node in SETTINGS])
def test_a_settings_class_is_frozen_and_documents_every_value(node):
    assert any("frozen=True" in ast.unparse(decorator) for decorator in node.decorator_list)
    fields = [
        s.target.id for s in node.body if isinstance(s, ast.AnnAssign) and isinstance(s.target, ast.Name)
    ]
    documented = {
        name
        for line in (ast.get_docstring(node) or "").splitlines()
        if re.fullmatch(r"\w+(, \w+)*( : .*)?", line)
        for name in re.split(r", ", line.partition(" : ")[0])
    }
    assert set(fields) <= documented
