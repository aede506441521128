"""What is wrong with a measured data set: one record per problem, collected rather than raised."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from srs_opt.errors import InputError

Severity = Literal["error", "warning"]
MAX_PER_FILE = 25


@dataclass(frozen=True)
class Problem:
    """One problem of a data set.

    Attributes
    ----------
    file : str
        File it was found in, relative to the data set's folder.
    line : int or None
        Line in that file, from 1.
    message : str
        What is wrong and what was expected.
    severity : {"error", "warning"}
        An error keeps the set from being read; a warning does not.
    """

    file: str
    line: int | None
    message: str
    severity: Severity = "error"

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        return f"{place}: {self.message}"


class Report:
    """Collects the problems of one folder, at most `MAX_PER_FILE` of a kind per file."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.problems: list[Problem] = []
        self._counts: dict[tuple[str, Severity], int] = {}

    def error(self, file: str, line: int | None, message: str) -> None:
        """Add a problem that keeps the set from being read."""
        self._add(Problem(file, line, message, "error"))

    def warn(self, file: str, line: int | None, message: str) -> None:
        """Add something that a person should know, and that reading can live with."""
        self._add(Problem(file, line, message, "warning"))

    def _add(self, problem: Problem) -> None:
        # a quoted cell may hold line ends, and what it is quoted in must stay one line
        message = "".join(c if c.isprintable() else " " for c in problem.message)
        problem = replace(problem, message=message)
        key = (problem.file, problem.severity)
        count = self._counts[key] = self._counts.get(key, 0) + 1
        if count <= MAX_PER_FILE:
            self.problems.append(problem)
        elif count == MAX_PER_FILE + 1:
            text = f"more {problem.severity}s in this file, not listed"
            self.problems.append(Problem(problem.file, None, text, problem.severity))

    def add_input_error(self, file: str, error: InputError) -> None:
        """Add an error raised by another reader, with its line when it names one."""
        text = str(error)
        for prefix in (str(self.folder / file), file):
            if text.startswith(prefix):
                text = text[len(prefix) :]
                break
        match = re.match(r":(\d+)?:?\s*", text)
        line = int(match.group(1)) if match and match.group(1) else None
        self.error(file, line, text[match.end() :] if match else text)

    def errors(self) -> list[Problem]:
        """Return the errors alone."""
        return [p for p in self.problems if p.severity == "error"]

    def ordered(self) -> list[Problem]:
        """Return all problems, errors first, by file and line."""
        return sorted(self.problems, key=lambda p: (p.severity != "error", p.file, p.line or 0))
