"""Sweeps over many independent items.

The work is cut into chunks in a fixed way, whatever runs them, so results do not depend on where. With a
`Resume` every chunk's results are kept in a file until the sweep is over, so an interrupted one goes on.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from srs_opt.files import write_text
from srs_opt.parallel.protocol import HERE, Executor

SOURCES = (".py", ".json", ".yaml")

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class Resume:
    """Where a sweep keeps its finished chunks, one file each, named by everything they depend on.

    Results must be what JSON holds (numbers come back to the last bit; tuples come back as lists).

    Attributes
    ----------
    folder : Path
    key : str
        Says what the work is, besides the items and this package's sources: robot, model, settings.
    """

    folder: Path
    key: str

    def load(self, piece: Sequence[Any]) -> list[Any] | None:
        """Return a chunk's results, None if they are not there (or not whole)."""
        try:
            results = json.loads(self._file(piece).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return results if isinstance(results, list) and len(results) == len(piece) else None

    def save(self, piece: Sequence[Any], results: list[Any]) -> None:
        """Keep a chunk's results, atomically."""
        write_text(self._file(piece), json.dumps(results))

    def _file(self, piece: Sequence[Any]) -> Path:
        parts = [source_digest(Path(__file__).resolve().parents[1]), self.key, repr(list(piece))]
        digest = hashlib.sha256("\0".join(parts).encode())
        return self.folder / f"{digest.hexdigest()[:32]}.json"


@lru_cache
def source_digest(package: Path) -> str:
    """Return a hash of a package's programs and of the tables and robots that come with it."""
    digest = hashlib.sha256()
    for file in sorted(package.rglob("*")):
        if file.suffix in SOURCES:
            digest.update(file.read_bytes())
    return digest.hexdigest()


def chunks(items: Sequence[T], size: int) -> list[Sequence[T]]:
    """Cut `items` into consecutive pieces of at most `size`."""
    return [items[k : k + size] for k in range(0, len(items), size)]


def sweep(
    work: Callable[[Sequence[T]], list[R]],
    items: Sequence[T],
    *,
    chunk: int,
    where: Executor = HERE,
    what: str = "",
    quiet: bool = True,
    resume: Resume | None = None,
) -> Iterator[R]:
    """Yield ``work`` of all items in order, chunk by chunk, with a progress bar.

    Nothing is held but the chunks under way.

    Parameters
    ----------
    work : callable
        Takes a chunk, returns a result per item; must be picklable when it runs elsewhere.
    chunk : int
        Items per task: enough for about half a second.
    where : Executor
        Who does it.
    resume : Resume, optional
        Chunks found there are not computed again; the others are kept there as they come in.
    """
    from tqdm import tqdm

    pieces = chunks(items, chunk)
    known = {k for k, piece in enumerate(pieces) if resume is not None and resume.load(piece) is not None}
    fresh = where.map(work, [piece for k, piece in enumerate(pieces) if k not in known])
    with tqdm(total=len(items), desc=what, disable=quiet or None, leave=False) as bar:
        for k, piece in enumerate(pieces):
            results = _recalled(resume, piece, work) if k in known else next(fresh)
            if resume is not None and k not in known:
                resume.save(piece, results)
            bar.update(len(results))
            yield from results


def _recalled(resume: Resume | None, piece: Sequence[T], work: Callable[[Sequence[T]], list[R]]) -> list[R]:
    """Return kept results, or compute them if their file has vanished meanwhile."""
    results = None if resume is None else resume.load(piece)
    return work(piece) if results is None else results
