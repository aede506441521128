"""Integrations for several searches at once.

A search is a generator: it yields a request for an integration and is sent its result. So
many searches, each with its own gait, robot and mesh, share the lanes of a compiled kernel without knowing
of each other.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.simulate.kernel import LANES, Course, Kernel
from srs_opt.simulate.mesh import Mesh

UNDER_WAY = 4 * LANES  # searches at once: enough to find partners of like length
T = TypeVar("T")


@dataclass(frozen=True)
class StepRequest:
    """Take `kernel` from state `x` (nx,) over `mesh` with `valve` (N-1, phases) held and `p`."""

    kernel: Kernel
    x: np.ndarray
    mesh: Mesh
    valve: np.ndarray
    p: np.ndarray


@dataclass(frozen=True)
class StepResult:
    """What came of it: states (nx, n) after each step and estimated errors (n,), m/s."""

    states: np.ndarray
    error_m_s: np.ndarray


Search = Generator[StepRequest, StepResult, T]


def run_batched(searches: Sequence[Search[T]]) -> list[T | NoAnswerError]:
    """Run searches side by side; return what each found, or why it found nothing.

    Lanes never mix, so the company makes no difference to a result.
    """
    results: list[T | NoAnswerError] = [NoAnswerError("not searched")] * len(searches)
    waiting: dict[Kernel, list[tuple[int, StepRequest]]] = {}

    def advance(index: int, result: StepResult | None) -> None:
        search = searches[index]
        try:
            request = next(search) if result is None else search.send(result)
        except StopIteration as done:
            results[index] = done.value
        except NoAnswerError as error:
            results[index] = error
        else:
            waiting.setdefault(request.kernel, []).append((index, request))

    fresh = deque(range(len(searches)))
    while fresh or waiting:
        while fresh and sum(map(len, waiting.values())) < UNDER_WAY:
            advance(fresh.popleft(), None)
        if not waiting:
            break
        # the kernel that most wait for: its lanes are full
        kernel = max(waiting, key=lambda k: len(waiting[k]))
        # alike lengths share a call: the short rest while the long go on
        queue = sorted(waiting.pop(kernel), key=lambda entry: entry[1].mesh.h_s.size)
        chosen, rest = queue[-LANES:], queue[:-LANES]
        if rest:
            waiting[kernel] = rest
        for (index, _), result in zip(chosen, _results(kernel, [request for _, request in chosen])):
            advance(index, result)
    return results


def run_one(search: Search[T]) -> T:
    """Run one search.

    Raises
    ------
    NoAnswerError
        As the search does.
    """
    (result,) = run_batched([search])
    if isinstance(result, NoAnswerError):
        raise result
    return result


def _results(kernel: Kernel, requests: Sequence[StepRequest]) -> list[StepResult]:
    courses = [Course(w.x, w.mesh.h_s, w.valve.T[w.mesh.phase], w.p) for w in requests]
    states, errors = kernel.run(courses)
    sizes = [w.mesh.h_s.size for w in requests]
    return [StepResult(np.ascontiguousarray(states[:n, :, k].T), errors[:n, k]) for k, n in enumerate(sizes)]
