"""What results of the library have in common: words, a record, a file, a picture."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any

from srs_opt.files import write_json

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Result(ABC):
    """Base of results: a short text, `to_dict`, `save`, `plot`, and the picture in a notebook."""

    @abstractmethod
    def in_words(self) -> str:
        """Return the result in one line."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return the result as JSON can hold it; units are in the names of the keys."""

    @abstractmethod
    def figure(self) -> Figure:
        """Return the result's picture as a matplotlib figure, which no window shows."""

    def save(self, path: Path | str) -> Path:
        """Write `to_dict` as JSON, whole or not at all; return the path."""
        return write_json(path, self.to_dict())

    def plot(self) -> list[Axes]:
        """Draw the picture; return its axes (``.figure.savefig("x.pdf")`` writes it)."""
        return list(self.figure().axes)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.in_words()}>"

    def _repr_png_(self) -> bytes:
        from srs_opt.figures import png_of

        return png_of(self.figure(), dpi=120)
