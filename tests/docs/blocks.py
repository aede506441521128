"""Code blocks of Markdown pages: what to write, run and compare."""

import math
import re
from dataclasses import dataclass

FENCE = re.compile(r"^(\s*)```(\w*)\s*$")
MARK = re.compile(r"^\s*<!--\s*(test|file):\s*(.+?)\s*-->\s*$")
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
TIMES = re.compile(r"(\d+(?:\.\d+)?) (s|ms|min|MB|kB)\b")
RELATIVE = 0.05


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, text, first line in the page, and the marks before it."""

    language: str
    text: str
    line: int
    file: str | None
    skip: str | None
    slow: bool


def blocks(page: str) -> list[Block]:
    """Return the fenced blocks of a page."""
    found: list[Block] = []
    marks: dict[str, str] = {}
    lines = iter(enumerate(page.splitlines(), start=1))
    for number, line in lines:
        mark, fence = MARK.match(line), FENCE.match(line)
        if mark:
            marks[mark[1]] = mark[2]
        elif fence:
            indent, inside = len(fence[1]), []
            for _, text in lines:
                if text.strip() == "```":
                    break
                inside.append(text[indent:])
            test = marks.get("test", "")
            skip = test.removeprefix("skip,").strip() if test.startswith("skip") else None
            file = marks.get("file")
            found.append(Block(fence[2], "\n".join(inside) + "\n", number, file, skip, test == "slow"))
            marks = {}
        elif line.strip():
            marks = {}
    return found


def commands(block: Block) -> list[tuple[str, int, list[str]]]:
    """Return (command, expected exit status, shown output) of a console block."""
    found: list[tuple[str, int, list[str]]] = []
    for line in block.text.splitlines():
        if line.startswith("$ "):
            command, _, note = line[2:].partition("  # ")
            status = re.search(r"exit status (\d+)", note)
            found.append((command, int(status[1]) if status else 0, []))
        elif found:
            found[-1][2].append(line)
    return found


def same_output(shown: list[str], real: list[str]) -> bool:
    """Whether output fits what a page shows: numbers to 5 %, times at will, ``...`` for any lines.

    A page that shows no output asks for none in particular.
    """
    return not shown or _matches(shown, real)


def _matches(shown: list[str], real: list[str]) -> bool:
    if not shown:
        return not real
    if shown[0].strip() == "...":
        return any(_matches(shown[1:], real[k:]) for k in range(len(real) + 1))
    return bool(real) and same_line(shown[0], real[0]) and _matches(shown[1:], real[1:])


def same_line(shown: str, real: str) -> bool:
    """Compare a line; a ``...`` at its end stands for the rest."""
    shown, real = (TIMES.sub(r"<time> \2", x.rstrip()) for x in (shown, real))
    if shown.endswith("..."):
        parts = NUMBER.split(shown.removesuffix("...").rstrip())
        head = NUMBER.split(real)
        if not parts[-1].strip() and len(parts) > 1:
            parts = parts[:-1]
        if parts[:-1] != head[: len(parts) - 1] or not head[len(parts) - 1].startswith(parts[-1].rstrip()):
            return False
        numbers = NUMBER.findall(shown)
        return all(close(a, b) for a, b in zip(numbers, NUMBER.findall(real)))
    if NUMBER.sub("#", shown) != NUMBER.sub("#", real):
        return False
    return all(close(a, b) for a, b in zip(NUMBER.findall(shown), NUMBER.findall(real)))


def close(shown: str, real: str) -> bool:
    """Numbers agree to 5 %, or both are tiny; counts and versions without a point must be equal."""
    if "." not in shown and "e" not in shown.lower():
        return shown == real
    a, b = float(shown), float(real)
    return math.isclose(a, b, rel_tol=RELATIVE, abs_tol=1e-3) or max(abs(a), abs(b)) < 1e-3
