"""The example notebooks run, and what they show is what is stored in them."""

import json
import re

import pytest

from docs.make_notebooks import NOTEBOOKS, run_notebook

MOST_KB = 250


def shown(notebook):
    """Return each code cell's outputs as words without numbers, and which pictures there are."""
    found = []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            texts = ["".join(o.get("text", o.get("data", {}).get("text/plain", ""))) for o in cell["outputs"]]
            kinds = [sorted(o.get("data", ())) for o in cell["outputs"]]
            found.append(([re.sub(r"[-+]?\d[\d.]*", "#", text) for text in texts], kinds))
    return found


def test_there_are_two_small_notebooks():
    assert len(NOTEBOOKS) == 2
    for path in NOTEBOOKS:
        assert path.stat().st_size < 1000 * MOST_KB


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_shows_what_is_stored_in_it(path):
    stored = json.loads(path.read_text(encoding="utf-8"))
    pictures = sum("image/png" in kinds for _, cell in shown(stored) for kinds in cell)
    assert stored["nbformat"] == 4 and pictures >= 2
    assert shown(run_notebook(stored, path.parent)) == shown(stored)
