"""Every problem of a data set's folder at once."""

from __future__ import annotations

from pathlib import Path

from srs_opt.measurement.read import read_folder
from srs_opt.problem import Problem, Report


def problems(folder: Path | str) -> list[Problem]:
    """Return every problem of the data set in `folder`, errors first; an empty list when it is fine."""
    report = Report(Path(folder))
    read_folder(Path(folder), report)
    return report.ordered()
