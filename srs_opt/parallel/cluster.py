"""A Dask cluster: any worker may be lost at any time, the scheduler not."""

from __future__ import annotations

import contextlib
import logging
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from srs_opt.errors import InputError, NoAnswerError
from srs_opt.parallel.protocol import Groups, Shared, Work
from srs_opt.parallel.settings import CLUSTER

if TYPE_CHECKING:
    from distributed import Client, Future


T = TypeVar("T")
R = TypeVar("R")


@contextlib.contextmanager
def opened(address: str) -> Iterator[Cluster]:
    """Connect to the Dask scheduler at `address`, ``host:port``, and wait until it has a worker.

    Raises
    ------
    InputError
        If the package is missing, nobody answers there, or no worker comes.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError("--cluster needs the package 'distributed': pip install srs-opt[cluster]") from error
    logs = [logging.getLogger(name) for name in ("distributed", "asyncio")]
    before = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL + 1)  # what goes wrong is told once, by us
    try:
        try:
            client = Client(address, timeout=CLUSTER.connect_s)
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(
                f"--cluster {address}: no Dask scheduler answers there within {CLUSTER.connect_s:g} s "
                "(expected host:port)"
            ) from error
        try:
            cluster = Cluster(client, address)
            cluster.wait_for_workers()
            yield cluster
        finally:
            with contextlib.suppress(OSError, TimeoutError):
                client.close(timeout=CLUSTER.connect_s)
    finally:
        for log, level in zip(logs, before):
            log.setLevel(level)


class Cluster:
    """The workers of a Dask scheduler.

    Parameters
    ----------
    client : Client
    address : str
        For messages.
    """

    def __init__(self, client: Client, address: str) -> None:
        self._client, self._address = client, address
        self._alone_since: float | None = None

    def wait_for_workers(self) -> None:
        """Wait for the first worker.

        Raises
        ------
        InputError
            If none comes within ``CLUSTER.workers_s``.
        """
        try:
            self._client.wait_for_workers(1, timeout=CLUSTER.workers_s)
        except TimeoutError as error:
            raise InputError(
                f"--cluster {self._address}: the scheduler has no worker, and none came within "
                f"{CLUSTER.workers_s:g} s; start one: dask worker {self._address}"
            ) from error

    def map(self, work: Callable[[T], R], pieces: Sequence[T]) -> Iterator[R]:
        """Yield ``work(piece)`` of all pieces in order; a piece whose worker is lost goes to another."""
        under_way: deque[Future] = deque()
        width = CLUSTER.pieces_per_thread * max(1, sum(self._client.nthreads().values()))
        rest = iter(pieces)
        while True:
            while len(under_way) < width and (piece := next(rest, None)) is not None:
                # pure=False: a work with memory may answer differently when asked the same again
                under_way.append(self._client.submit(work, piece, pure=False))
            if not under_way:
                return
            yield self.results([under_way.popleft()])[0]

    def share(self, work: Work, groups: Groups) -> Shared:
        """Return the work, done piecewise by whoever is free: a piece takes its memory along."""
        return _Carried(self, work)

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Hand one task in."""
        return self._client.submit(function, *arguments, pure=False)

    def results(self, tasks: Sequence[Future]) -> list[Any]:
        """Return the tasks' results; their exceptions are raised.

        Raises
        ------
        NoAnswerError
            If the scheduler or all workers are lost meanwhile, or a task kills every worker that it gets.
        """
        from asyncio import CancelledError
        from asyncio import TimeoutError as NotYet
        from concurrent.futures import CancelledError as Cancelled

        from distributed import wait
        from distributed.comm.core import CommClosedError
        from distributed.scheduler import KilledWorker

        try:
            while True:
                try:
                    wait(tasks, timeout=CLUSTER.poll_s)
                    return self._gathered(tasks)
                except (NotYet, TimeoutError):
                    self._look_for_workers()
        except (CancelledError, Cancelled, CommClosedError) as error:
            raise NoAnswerError(
                f"--cluster {self._address}: the connection to the Dask scheduler was lost; start it again, "
                "then the same command"
            ) from error
        except KilledWorker as error:
            raise NoAnswerError(
                f"--cluster {self._address}: one piece of work killed several workers, one after the other "
                "(out of memory?)"
            ) from error

    def _gathered(self, tasks: Sequence[Future]) -> list[Any]:
        """Fetch results that are ready. A limit of time: if the worker that holds one is lost meanwhile, the
        scheduler hands the work out anew, and waits for ever where no worker is left."""

        async def gather() -> list[Any]:
            return list(await self._client.gather(list(tasks), asynchronous=True))

        return list(self._client.sync(gather, callback_timeout=CLUSTER.gather_s))

    def _look_for_workers(self) -> None:
        if self._client.nthreads():
            self._alone_since = None
            return
        now = time.monotonic()
        self._alone_since = self._alone_since or now
        if now - self._alone_since > CLUSTER.workers_s:
            raise NoAnswerError(
                f"--cluster {self._address}: all workers were lost, and none came back within "
                f"{CLUSTER.workers_s:g} s"
            )


class _Carried:
    """A work of which every task carries all that it depends on, so that it can be done again elsewhere."""

    def __init__(self, cluster: Cluster, work: Work) -> None:
        self._cluster, self._work = cluster, work

    def ask(self, names: Sequence[str], request: Any) -> dict[str, Any]:
        """Return the items' answers."""
        tasks = []
        for first in range(0, len(names), CLUSTER.items_per_task):
            some = names[first : first + CLUSTER.items_per_task]
            memory = self._work.memory(some, request)
            tasks.append(self._cluster.submit(answered, self._work.part(some), some, memory, request))
        found: dict[str, Any] = {}
        for answers, memory in self._cluster.results(tasks):
            self._work.remember(memory)
            found.update(answers)
        return found


def answered(work: Work, names: Sequence[str], memory: Any, request: Any) -> tuple[dict[str, Any], Any]:
    """Return the answers, and what to go on with; runs on a worker."""
    work.remember(memory)
    answers = work.answer(names, request)
    return answers, work.memory(names, None)
