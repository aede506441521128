"""Text of tables from anywhere: UTF-8, UTF-16 or Latin-1; commas, semicolons, tabs or blanks; 1.5 or 1,5."""

from __future__ import annotations

import codecs
import csv
import io
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from srs_opt.errors import InputError
from srs_opt.files import read_bytes
from srs_opt.measurement.records import Array

WHAT = "a table of positions"
# separator and decimal sign, in order of preference when a table fits several
STYLES = ((",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", "."), (" ", ","))
SAMPLED = 40  # lines, from the end, that tell the style
_NOTHING = re.compile(r"[+-]?(?:nan(?:\(\w*\))?|1\.#\w+|n/?a|#n/a|null|none|inf(?:inity)?)?", re.IGNORECASE)


@dataclass(frozen=True)
class Sheet:
    """Non-empty lines with their numbers, cells stripped."""

    path: Path
    rows: tuple[tuple[int, tuple[str, ...]], ...]
    separator: str
    decimal: str
    told: tuple[str, ...]

    def number(self, row: int, column: int) -> float:
        """Return a cell as a number, NaN where it is empty or spells no number in a known way.

        Raises
        ------
        InputError
            If the cell holds anything else.
        """
        line, cells = self.rows[row]
        text = cells[column] if column < len(cells) else ""
        value = parse(text, self.decimal)
        if value is None:
            raise InputError(
                f"{self.path}:{line}: expected a number or an empty cell, found '{printable(text)}'"
            )
        return value

    def numbers(self, first: int, columns: list[int]) -> Array:
        """Return the cells of all rows from `first` on, shape (rows, columns)."""
        out = np.empty((len(self.rows) - first, len(columns)))
        for i in range(out.shape[0]):
            for k, column in enumerate(columns):
                out[i, k] = self.number(first + i, column)
        return out


def printable(text: str) -> str:
    """Return the beginning of a cell, fit for a message of one line."""
    return "".join(c if c.isprintable() else " " for c in text[:40])


def parse(text: str, decimal: str = ".") -> float | None:
    """Return the number that `text` spells; NaN for empty cells and for what programs write there.

    None when it spells no number. Infinities count as nothing seen.
    """
    if "_" in text:
        return None
    if decimal == ",":
        if "." in text and "," in text:
            return None
        text = text.replace(",", ".")
    try:
        value = float(text)
    except ValueError:
        return math.nan if _NOTHING.fullmatch(text.strip()) else None
    return value if math.isfinite(value) else math.nan


def decode(data: bytes) -> tuple[str, str]:
    """Return text, and which encoding was guessed ('' for UTF-8 and for files that say theirs)."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace"), ""
    sample = data[:400]
    if len(sample) > 3 and (
        sample[1::2].count(0) > len(sample) / 4 or sample[::2].count(0) > len(sample) / 4
    ):
        little = sample[1::2].count(0) >= sample[::2].count(0)
        return data.decode("utf-16-le" if little else "utf-16-be", errors="replace"), "UTF-16"
    try:
        return data.decode("utf-8-sig"), ""
    except UnicodeDecodeError:
        return data.decode("latin-1"), "Latin-1"


def read_lines(path: Path) -> tuple[str, list[str]]:
    """Return a file's text with Unix line ends, and what was guessed."""
    text, guess = decode(read_bytes(path, WHAT))
    text = text.replace("\r\n", "\n").replace("\r", "\n").replace("\x00", "")
    return text, [f"read as {guess} text"] if guess else []


def read_sheet(path: Path, style: tuple[str, str] | None = None) -> Sheet:
    """Read a table; separator and decimal sign are found from its last lines.

    Raises
    ------
    InputError
        If the file is empty or no table.
    """
    text, told = read_lines(path)
    if style is None:
        style = _style(path, text)
    separator, decimal = style
    try:
        rows = tuple(_rows(text, separator))
    except csv.Error as error:
        raise InputError(f"{path}: not a table: {error}") from error
    if not rows:
        raise InputError(f"{path}: is empty (expected {WHAT})")
    if decimal == ",":
        told.append("numbers are written with decimal commas")
    return Sheet(path, rows, separator, decimal, tuple(told))


def _rows(text: str, separator: str) -> list[tuple[int, tuple[str, ...]]]:
    if separator == " ":
        lines = ((i, tuple(line.split())) for i, line in enumerate(text.split("\n"), start=1))
        return [(i, cells) for i, cells in lines if cells]
    stream = io.StringIO(text, newline="")
    if separator == "\t":  # names may hold quotation marks there
        reader = csv.reader(stream, delimiter=separator, quoting=csv.QUOTE_NONE)
    else:
        reader = csv.reader(stream, delimiter=separator)
    return [
        (reader.line_num, tuple(cell.strip() for cell in cells))
        for cells in reader
        if any(cell.strip() for cell in cells)
    ]


def _style(path: Path, text: str) -> tuple[str, str]:
    lines = [line for line in text.rstrip("\n").split("\n")[-SAMPLED:] if line.strip()]
    best, found = 0.0, STYLES[0]
    for separator, decimal in STYLES:
        split = [line.split() if separator == " " else line.split(separator) for line in lines]
        counts = [len(cells) for cells in split]
        width = max(set(counts), key=counts.count) if counts else 0
        if width < 2:
            continue
        whole = [cells for cells in split if len(cells) == width]
        values = [parse(cell.strip(), decimal) for cells in whole for cell in cells]
        good = sum(v is not None and math.isfinite(v) for v in values)
        bad = sum(v is None for v in values)
        score = (good - bad) / len(lines) * len(whole) / len(lines)
        # a blank inside a label must not split what another separator keeps whole
        if score > best * (1.0 + 1e-9):
            best, found = score, (separator, decimal)
    return found
