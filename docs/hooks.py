"""MkDocs hooks: benchmark results and schemas stand elsewhere in the tree and join the site here."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results.md"
NOT_YET = "Nothing is measured yet: `make bench` does it."
SCHEMA = re.compile(r"\]\(\.\./[\w/]+/(\w+\.schema\.json)\)")


def on_files(files: Files, config: Any) -> Files:
    """Add the benchmarks' pictures and the JSON schemas of the file formats."""
    pictures = sorted((ROOT / "benchmarks" / "pictures").glob("*.png"))
    schemas = [
        p for package in ("srs_opt", "planners") for p in sorted((ROOT / package).rglob("*.schema.json"))
    ]
    for folder, paths in (("pictures", pictures), ("schemas", schemas)):
        for path in paths:
            files.append(File.generated(config, f"{folder}/{path.name}", abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Put the measured results where the page asks for them; point links to schemas into the site."""
    if page.file.src_uri == "benchmarks.md":
        results = RESULTS.read_text(encoding="utf-8") if RESULTS.exists() else NOT_YET
        markdown = markdown.replace("<!-- results -->", results.partition("\n")[2] or results)
    return SCHEMA.sub(r"](schemas/\1)", markdown)
