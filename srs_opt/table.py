"""CSV tables read whole, with every bad cell reported by file and line."""

from __future__ import annotations

import csv
import difflib
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from srs_opt.document import unknown_word
from srs_opt.errors import InputError
from srs_opt.files import read_text
from srs_opt.problem import Report

Array = NDArray[np.float64]

NOT_A_NUMBER = ("", "nan", "na")
MAX_ROWS = 2_000_000


@dataclass(frozen=True)
class Row:
    """One line of a table: its cells by column name."""

    file: str
    line: int
    cells: dict[str, str]

    def text(self, column: str) -> str:
        """Return the cell as text ('' when the column is absent)."""
        return self.cells.get(column, "")

    def number(self, column: str, report: Report, default: float | None = None) -> float:
        """Return the cell as a finite number; report and return NaN when it is none.

        An empty cell gives `default`, when there is one.
        """
        text = self.cells.get(column, "")
        if not text and default is not None:
            return default
        value = to_number(text)
        if value is None or not math.isfinite(value):
            found = f"'{text[:40]}'" if text else "an empty cell"
            report.error(self.file, self.line, f"{column}: expected a number, found {found}")
            return math.nan
        return value

    def word(self, column: str, allowed: Sequence[str], default: str, report: Report) -> str:
        """Return the cell, which must be one of `allowed` (`default` when empty)."""
        text = self.cells.get(column, "") or default
        if text not in allowed:
            report.error(self.file, self.line, f"{column}: {unknown_word('word', text, list(allowed))}")
            return default
        return text

    def yes(self, column: str, default: bool, report: Report) -> bool:
        """Return a yes/no cell as a boolean."""
        return self.word(column, ("yes", "no"), "yes" if default else "no", report) == "yes"


def to_number(text: str) -> float | None:
    """Return the number that `text` spells, NaN for an empty cell, None when it spells none."""
    text = text.strip()
    if text.lower() in NOT_A_NUMBER:
        return math.nan
    if "_" in text:  # Python would read 1_000 as a number
        return None
    try:
        return float(text)
    except ValueError:
        return None


def read_table(
    path: Path | str, required: Sequence[str], optional: Sequence[str] = ()
) -> tuple[list[Row], Report]:
    """Read a table that stands alone: its rows, and a report to read their cells with.

    `first_error` raises what was reported.
    """
    path = Path(path)
    report = Report(path.parent)
    return read_rows(path.name, required, optional, report), report


def first_error(report: Report) -> None:
    """Raise the first error reported, if there is one.

    Raises
    ------
    InputError
        With file, line and the number of further errors.
    """
    errors = report.errors()
    if errors:
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        place = f"{report.folder / errors[0].file}" + (f":{errors[0].line}" if errors[0].line else "")
        raise InputError(f"{place}: {errors[0].message}{more}")


def read_rows(file: str, required: Sequence[str], optional: Sequence[str], report: Report) -> list[Row]:
    """Read a small table; report missing and unknown columns, short and long lines.

    Rows are returned even when columns are missing, so that their other cells get checked too.
    """
    lines = _read_lines(file, report)
    if not lines:
        return []
    header = [name.strip() for name in lines[0][1]]
    if not _check_header(file, lines[0][0], header, required, optional, report):
        return []
    rows = []
    for number, cells in lines[1:]:
        if len(cells) != len(header):
            report.error(file, number, f"{len(cells)} cells where the header has {len(header)} columns")
            continue
        rows.append(Row(file, number, {name: cell.strip() for name, cell in zip(header, cells)}))
    if not rows:
        report.error(file, None, "has a header but no rows")
    return rows


def _check_header(
    file: str, line: int, header: list[str], required: Sequence[str], optional: Sequence[str], report: Report
) -> bool:
    known = [*required, *optional]
    for name in sorted({n for n in header if header.count(n) > 1}):
        report.error(file, line, f"column '{name[:40]}' appears twice")
    missing = [name for name in required if name not in header]
    for name in missing:
        hint = " (cells must be separated by commas)" if len(header) == 1 and ";" in header[0] else ""
        report.error(file, line, f"column '{name}' is missing{hint}")
    for name in header:
        if name and name not in known:
            if difflib.get_close_matches(name, known, n=1, cutoff=0.8):  # a slip would be ignored silently
                report.error(file, line, unknown_word("column", name, known))
            else:
                report.warn(file, line, f"column '{name[:40]}' is not part of the layout and is ignored")
    return not missing


def _read_lines(file: str, report: Report) -> list[tuple[int, list[str]]]:
    """Return the non-empty lines of a CSV file with their numbers ([] and a report when unreadable)."""
    text = text_of(file, report)
    if text is None:
        return []
    lines: list[tuple[int, list[str]]] = []
    reader = csv.reader(io.StringIO(text, newline=""))
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells):
                lines.append((reader.line_num, cells))
    except csv.Error as error:
        report.error(file, reader.line_num, f"not a CSV table: {error}")
        return []
    if not lines:
        report.error(file, None, "is empty (expected a header line and rows)")
    return lines


def text_of(file: str, report: Report) -> str | None:
    """Return the text of a file of the set, None (and a report) when it cannot be read."""
    try:
        return read_text(report.folder / file, "a CSV table")
    except InputError as error:
        report.add_input_error(file, error)
        return None


@dataclass(frozen=True, eq=False)
class NumberTable:
    """A table of numbers: header, values (rows, columns) with NaN for empty cells, and line numbers."""

    header: tuple[str, ...]
    values: Array
    lines: tuple[int, ...] | range

    def column(self, name: str) -> Array:
        """Return one column."""
        return self.values[:, self.header.index(name)]


def read_numbers(file: str, report: Report) -> NumberTable | None:
    """Read a table that holds numbers only; None when it has no usable rows.

    A clean file takes a fast path; a file with a fault is read again cell by cell to say where it is.
    """
    text = text_of(file, report)
    if text is None:
        return None
    return _clean_numbers(text) or _faulty_numbers(file, report)


def _clean_numbers(text: str) -> NumberTable | None:
    lines = text.rstrip("\n").split("\n")
    header = tuple(name.strip() for name in lines[0].split(","))
    body = lines[1:]
    commas = len(header) - 1
    if not body or len(body) > MAX_ROWS or any(line.count(",") != commas for line in body) or '"' in text:
        return None
    cells = ",".join(body).split(",")
    try:
        values = np.array([float(cell) if cell else math.nan for cell in cells])
    except ValueError:
        return None
    if np.isinf(values).any() or "_" in text[len(lines[0]) :]:
        return None
    return NumberTable(header, values.reshape(len(body), len(header)), range(2, 2 + len(body)))


def _faulty_numbers(file: str, report: Report) -> NumberTable | None:
    lines = _read_lines(file, report)
    if len(lines) < 2:
        if lines:
            report.error(file, None, "has a header but no rows")
        return None
    header = tuple(name.strip() for name in lines[0][1])
    rows, numbers = [], []
    for number, cells in lines[1:]:
        if len(cells) != len(header):
            report.error(file, number, f"{len(cells)} cells where the header has {len(header)} columns")
            continue
        row = [to_number(cell) for cell in cells]
        for name, cell, value in zip(header, cells, row):
            if value is None or math.isinf(value):
                text = cell.strip()[:40]
                report.error(file, number, f"{name[:40]}: expected a number or an empty cell, found '{text}'")
        rows.append([math.nan if v is None or math.isinf(v) else v for v in row])
        numbers.append(number)
    if not rows:
        return None
    return NumberTable(header, np.array(rows, dtype=float), tuple(numbers))


def safe_name(folder: Path, name: str) -> str | None:
    """Return why `name` may not be used as a file inside `folder`, or None when it may."""
    if not name or len(name) > 200 or any(ord(c) < 32 for c in name) or "\\" in name:
        return "is not a file name"
    path = Path(name)
    if path.is_absolute() or ".." in path.parts or name in (".", ""):
        return "leaves the data set's folder; files must lie inside it"
    try:
        if not (folder / path).resolve().is_relative_to(folder.resolve()):
            return "leads out of the data set's folder (a link?)"
    except (OSError, RuntimeError, ValueError):
        return "cannot be followed"
    return None
