"""Run the example notebooks afresh and keep what they show: python -m docs.make_notebooks."""

from __future__ import annotations

import ast
import base64
import io
import json
import os
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = tuple(sorted((ROOT / "examples").glob("*.ipynb")))
COLOURS = 64  # of a stored picture: a fifth of the size, and no difference to the eye


def run_notebook(notebook: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the notebook with its code cells run in order in `folder`, as plain Python, and their outputs.

    A kernel of its own would bring two dozen packages; what these notebooks need of one is the value of a
    cell's last expression.
    """
    names: dict[str, Any] = {"__name__": "__main__"}
    cells, count, before = [], 0, (Path.cwd(), list(sys.path))
    try:
        os.chdir(folder)
        for cell in notebook["cells"]:
            if cell["cell_type"] == "code":
                count += 1
                outputs = _outputs("".join(cell["source"]), names, count)
                cell = {**cell, "execution_count": count, "outputs": outputs}
            cells.append(cell)
    finally:
        os.chdir(before[0])
        sys.path[:] = before[1]
    return {**notebook, "cells": cells}


def _outputs(source: str, names: dict[str, Any], count: int) -> list[dict[str, Any]]:
    tree, told = ast.parse(source), io.StringIO()
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    value = None
    with redirect_stdout(told):
        exec(compile(tree, "<cell>", "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)
    outputs: list[dict[str, Any]] = []
    if told.getvalue():
        text = told.getvalue().splitlines(keepends=True)
        outputs.append({"output_type": "stream", "name": "stdout", "text": text})
    if value is not None:
        data: dict[str, Any] = {"text/plain": [repr(value)]}
        if hasattr(value, "_repr_png_"):
            data["image/png"] = base64.b64encode(_fewer_colours(value._repr_png_())).decode()
        outputs.append(
            {"output_type": "execute_result", "execution_count": count, "data": data, "metadata": {}}
        )
    return outputs


def _fewer_colours(png: bytes) -> bytes:
    from PIL import Image

    small = io.BytesIO()
    Image.open(io.BytesIO(png)).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(
        small, "png", optimize=True
    )
    return small.getvalue()


def main() -> int:
    """Write the notebooks with fresh outputs."""
    os.environ.setdefault("MPLBACKEND", "agg")
    for path in NOTEBOOKS:
        notebook = run_notebook(json.loads(path.read_text(encoding="utf-8")), path.parent)
        path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
