"""What takes work: one small protocol, and this process, which fulfils it too."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

T = TypeVar("T")
R = TypeVar("R")
Groups = Sequence[Mapping[str, float]]


class Work(Protocol):
    """Items that are asked again and again, and go on from what they found last.

    What an item answers depends on what that item was asked before, and on nothing that others were asked:
    so it does not matter who does it. A work is picklable.
    """

    def part(self, names: Sequence[str]) -> Work:
        """Return a fresh work of these items alone."""

    def answer(self, names: Sequence[str], request: Any) -> dict[str, Any]:
        """Return every item's answer. What an item cannot answer is an answer too, no exception."""

    def memory(self, names: Sequence[str], request: Any) -> Any:
        """Return what the items need in order to go on elsewhere with this request."""

    def remember(self, memory: Any) -> None:
        """Go on from there."""


class Shared(Protocol):
    """A work whose items have been given to those who do it."""

    def ask(self, names: Sequence[str], request: Any) -> dict[str, Any]:
        """Return the items' answers, in the order of `names`."""


class Executor(Protocol):
    """Takes pieces of work."""

    def map(self, work: Callable[[T], R], pieces: Sequence[T]) -> Iterator[R]:
        """Yield ``work(piece)`` of all pieces in order; only pieces under way are held in memory."""

    def share(self, work: Work, groups: Groups) -> Shared:
        """Hand out a work with memory.

        Parameters
        ----------
        work : Work
        groups : sequence of mappings
            Item -> cost, of items that are asked together, the most important group first.
        """


@dataclass(frozen=True)
class ThisProcess:
    """Does everything right here."""

    def map(self, work: Callable[[T], R], pieces: Sequence[T]) -> Iterator[R]:
        """Yield ``work(piece)`` of all pieces."""
        yield from map(work, pieces)

    def share(self, work: Work, groups: Groups) -> Shared:
        """Return the work as it is."""
        return _Own(work)


@dataclass(frozen=True)
class _Own:
    work: Work

    def ask(self, names: Sequence[str], request: Any) -> dict[str, Any]:
        return self.work.answer(names, request)


HERE = ThisProcess()
