"""Sweeps over many independent items: joblib's processes, or a Dask cluster's workers, same results.

The work is cut into chunks in a fixed way, whatever runs them, so results do not depend on where. With a
`Resume` every chunk's results are kept in a file until the sweep is over, so an interrupted one goes on.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from srs_opt.errors import InputError
from srs_opt.files import write_text
from srs_opt.processes import workers_deaf_to_interrupts

if TYPE_CHECKING:
    from distributed import Client

CONNECT_S = 10.0  # patience with a scheduler that does not answer

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
        parts = [source_digest(Path(__file__).resolve().parent), self.key, repr(list(piece))]
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
    jobs: int = 1,
    cluster: str | None = None,
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
    jobs : int
        Processes on this machine; one, or a single chunk, runs right here.
    cluster : str, optional
        Address of a Dask scheduler (``host:port``) that gets the chunks instead; a chunk whose worker is
        lost goes to another.
    resume : Resume, optional
        Chunks found there are not computed again; the others are kept there as they come in.
    """
    from tqdm import tqdm

    pieces = chunks(items, chunk)
    known = {k for k, piece in enumerate(pieces) if resume is not None and resume.load(piece) is not None}
    fresh = _run(work, [piece for k, piece in enumerate(pieces) if k not in known], jobs, cluster)
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


def _run(
    work: Callable[[Sequence[T]], list[R]], pieces: list[Sequence[T]], jobs: int, cluster: str | None
) -> Iterator[list[R]]:
    if cluster is None and (jobs == 1 or len(pieces) < 2):
        yield from map(work, pieces)
        return
    import joblib

    with _backend(jobs, cluster):
        parallel = joblib.Parallel(n_jobs=-1 if cluster else jobs, return_as="generator", batch_size=1)
        with workers_deaf_to_interrupts():
            results = parallel(joblib.delayed(work)(piece) for piece in pieces)
        yield from results


@contextlib.contextmanager
def _backend(jobs: int, cluster: str | None) -> Iterator[Any]:
    import joblib

    if cluster is None:
        from joblib.externals.loky.backend import resource_tracker

        resource_tracker.ensure_running()  # it, too, ends the blocking of interrupts when it starts
        with joblib.parallel_config("loky", n_jobs=jobs, inner_max_num_threads=1):
            yield
        return
    with connect(cluster), joblib.parallel_config("dask"):
        yield


def connect(cluster: str) -> Client:
    """Return a client of the Dask scheduler at `cluster`, ``host:port``; a context manager.

    Raises
    ------
    InputError
        If the package is missing or nobody answers there.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError("--cluster needs the package 'distributed': pip install srs-opt[cluster]") from error
    try:
        return Client(cluster, timeout=CONNECT_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"--cluster {cluster}: no Dask scheduler answers there (expected host:port)"
        ) from error
