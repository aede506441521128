"""The interactive page: one self-contained HTML file that works offline."""

from __future__ import annotations

import json
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from srs_opt.document import Document, load_schema, read_json, validate
from srs_opt.errors import InputError
from srs_opt.files import write_text

if TYPE_CHECKING:
    from jinja2 import Template

MOTION = "motion.json"


def find_motion(path: Path) -> Path:
    """Return the motion.json that `path`, a folder of the command plan or the file itself, stands for.

    Raises
    ------
    InputError
        If there is none.
    """
    file = path / MOTION if path.is_dir() else path
    if not file.is_file():
        raise InputError(f"{file}: no such file (expected a folder that `plan MAZE --out DIR` has filled)")
    return file


def read_motion(file: Path) -> dict[str, Any]:
    """Read and check a motion.json.

    Raises
    ------
    InputError
        If it is something else, or of another version.
    """
    document = read_json(file, "a motion (JSON of the command plan)")
    validate(document, load_schema("planners.view", "motion.schema.json"))
    record: dict[str, Any] = document.value
    for index, run in enumerate(record["runs"]):
        _check_run(document, ("runs", index), run, len(record["gaits"]))
    return record


def _check_run(document: Document, place: tuple[str | int, ...], run: dict[str, Any], gaits: int) -> None:
    """Complain of what a schema cannot see and the page would trip over."""
    if not run["cycles"]:
        raise document.error((*place, "cycles"), "is empty (expected [gait, start, joining] of every cycle)")
    for index, cycle in enumerate(run["cycles"]):
        if not (isinstance(cycle, list) and len(cycle) == 3 and cycle[0] in range(gaits)):
            raise document.error(
                (*place, "cycles", index),
                f"expected [index below {gaits} into gaits, start in s, joining or null], found {cycle}",
            )
    for key in ("body", "clearance_mm"):
        if len(run[key]) != len(run["centre"]):
            raise document.error(
                (*place, key), f"has {len(run[key])} instants where centre has {len(run['centre'])}"
            )


def save_page(motion: dict[str, Any], path: Path) -> Path:
    """Write the page of a motion."""
    # '<' never stands in the data as such, so that no name can end the script
    data = json.dumps(motion, separators=(",", ":")).replace("<", "\\u003c")
    title = f"{motion['robot']} in {motion['maze']['name'] or 'a maze'}"
    return write_text(path, _template().render(title=title, data=data))


@lru_cache(maxsize=1)
def _template() -> Template:
    from jinja2 import Environment

    text = resources.files("planners.view").joinpath("page.html.jinja").read_text(encoding="utf-8")
    return Environment(autoescape=True).from_string(text)
