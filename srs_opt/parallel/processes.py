"""Several processes on this machine; items with a memory stay where they are, so that little is sent."""

from __future__ import annotations

import contextlib
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from srs_opt.errors import NoAnswerError
from srs_opt.interrupts import workers_deaf_to_interrupts
from srs_opt.parallel.protocol import HERE, Groups, Shared, Work

T = TypeVar("T")
R = TypeVar("R")


class Processes:
    """Worker processes; a context manager.

    Parameters
    ----------
    jobs : int
        Number of processes, this one included.
    """

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self._teams: list[_Team] = []

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, *error: object) -> None:
        for team in self._teams:
            team.close(at_once=error[0] is not None)

    def map(self, work: Callable[[T], R], pieces: Sequence[T]) -> Iterator[R]:
        """Yield ``work(piece)`` of all pieces in order; a single piece is done right here."""
        if len(pieces) < 2:
            yield from map(work, pieces)
            return
        import joblib
        from joblib.externals.loky.backend import resource_tracker

        resource_tracker.ensure_running()  # it, too, ends the blocking of interrupts when it starts
        with joblib.parallel_config("loky", n_jobs=self.jobs, inner_max_num_threads=1):
            parallel = joblib.Parallel(n_jobs=self.jobs, return_as="generator", batch_size=1)
            with workers_deaf_to_interrupts():
                results = parallel(joblib.delayed(work)(piece) for piece in pieces)
            yield from results

    def share(self, work: Work, groups: Groups) -> Shared:
        """Give every process its share of the items, for good."""
        if sum(map(len, groups)) < 2:
            return HERE.share(work, groups)
        team = _Team(work, fair_shares(groups, self.jobs))
        self._teams.append(team)
        return team


class _Team:
    """The processes that share a work; the first share is done here."""

    def __init__(self, work: Work, shares: Sequence[Sequence[str]]) -> None:
        self._own, self._own_names = work, frozenset(shares[0])
        self._members: list[tuple[Any, Connection, frozenset[str]]] = []
        # a fork would copy locks and threads of numerical libraries in whatever state they are
        context = multiprocessing.get_context("spawn")
        for share in shares[1:]:
            if share:
                here, there = context.Pipe()
                process = context.Process(target=_serve, args=(there, work.part(share)), daemon=True)
                with workers_deaf_to_interrupts():
                    process.start()
                # only then does the end of the process show here as the end of the pipe
                there.close()
                self._members.append((process, here, frozenset(share)))

    def ask(self, names: Sequence[str], request: Any) -> dict[str, Any]:
        """Return the items' answers, every process working on its share.

        Raises
        ------
        NoAnswerError
            If a process has died.
        """
        asked = []
        found: dict[str, Any] = {}
        try:
            for _, connection, share in self._members:
                wanted = [n for n in names if n in share]
                if wanted:
                    connection.send((wanted, request))
                    asked.append(connection)
            found.update(self._own.answer([n for n in names if n in self._own_names], request))
            for connection in asked:
                reply = connection.recv()
                if isinstance(reply, Exception):
                    raise reply
                found.update(reply)
        except (EOFError, BrokenPipeError, ConnectionResetError) as error:
            raise NoAnswerError(
                "a worker process has died (killed, or out of memory); try fewer --jobs"
            ) from error
        # in the order asked for: sums over the answers then have the same bits however many processes there
        # are
        return {n: found[n] for n in names}

    def close(self, *, at_once: bool) -> None:
        """End the processes; `at_once` nobody waits for the work in hand."""
        for process, connection, _ in self._members:
            try:
                connection.send(None)
            except OSError:
                process.terminate()
            if at_once:
                process.terminate()
            process.join(timeout=10)
            connection.close()


def fair_shares(groups: Groups, jobs: int) -> list[list[str]]:
    """Return the items of every process: of each group, which is asked for together, as many to all.

    Who gets one more of a group gets one less of a later one.
    """
    shares: list[list[str]] = [[] for _ in range(jobs)]
    load = [0.0] * jobs
    for group in groups:
        counts = [0] * jobs
        for name, cost in group.items():
            fewest = min(counts)
            k = min((k for k in range(jobs) if counts[k] == fewest), key=lambda k: load[k])
            shares[k].append(name)
            counts[k] += 1
            load[k] += cost
    return shares


def _serve(connection: Connection, work: Work) -> None:
    """Answer requests until told to stop."""
    # a parent that has gone, between two requests or in the middle of one, is no failure of this process
    with contextlib.suppress(EOFError, OSError, KeyboardInterrupt):
        while (asked := connection.recv()) is not None:
            try:
                reply: object = work.answer(*asked)
            except Exception as error:  # the parent raises it
                reply = error
            connection.send(reply)
