"""Many steps of several gaits in one call of compiled code (see `lanes`); interpreted without a compiler."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import cast

import casadi as ca
import numpy as np

from srs_opt.simulate import compiled
from srs_opt.simulate.lanes import step_source
from srs_opt.simulate.zero_copy import ZeroCopy

LANES = 4  # gaits per call: a vector register of doubles on most machines, two on the others
# no fused multiply-adds: a gait's bits must not depend on the processor
_FLAGS = ("-O1", "-fPIC", "-shared", "-fno-math-errno", "-ffp-contract=off", "-w")
_DOUBLES = ctypes.POINTER(ctypes.c_double)


@dataclass(frozen=True)
class Course:
    """One gait's way through its steps.

    Attributes
    ----------
    x : array (nx,)
        State to start from.
    h_s : array (n,)
    valve : array (n, N-1)
        Held in each step.
    p : array (np,)
    """

    x: np.ndarray
    h_s: np.ndarray
    valve: np.ndarray
    p: np.ndarray


class Kernel:
    """A step function ``(x, valve, h, p) -> (x_next, error)`` run over many steps for up to LANES gaits."""

    def __init__(self, key: str, sizes: tuple[int, int, int], build: Callable[[], ca.Function]) -> None:
        self._nx, self._segments, self._np = sizes
        path = compiled.shared_library(key, build, lambda f, name: step_source(f, name, LANES), _flags())
        self._run = _loaded(path)
        self._slow = ZeroCopy(build()) if self._run is None else None

    def run(self, courses: Sequence[Course], *, keep: bool = True) -> tuple[np.ndarray, np.ndarray]:
        """Take every course through its own steps.

        Returns
        -------
        x : array (n or 1, nx, courses)
            States after each step of the longest course (a shorter one then rests); only the last without
            `keep`.
        error : array (n, courses)
        """
        if self._run is None:
            assert self._slow is not None
            return _interpreted(self._slow, self._nx, courses, keep)
        n, lanes = max(c.h_s.size for c in courses), len(courses)
        x0, p = np.empty((self._nx, LANES)), np.empty((self._np, LANES))
        # steps of length zero do nothing: a course that has ended rests
        h, valve = np.zeros((n, LANES)), np.zeros((n, self._segments, LANES))
        for k in range(LANES):  # spare lanes repeat the first course
            c = courses[k if k < lanes else 0]
            x0[:, k], p[:, k] = c.x, c.p
            h[: c.h_s.size, k], valve[: c.h_s.size, :, k] = c.h_s, c.valve
        x, error = np.empty((n if keep else 1, self._nx, LANES)), np.zeros((n, LANES))
        arrays = (a.ctypes.data_as(_DOUBLES) for a in (x0, valve, h, p, x, error))
        self._run(ctypes.c_long(n), ctypes.c_long(keep), *arrays)
        return x[:, :, :lanes], error[:, :lanes]


def _loaded(path: Path | None) -> Callable[..., None] | None:
    """Return the library's function of the same name, None where there is none that loads."""
    if path is None:
        return None
    try:
        function = getattr(ctypes.CDLL(str(path)), path.stem)
    except (OSError, AttributeError):  # made for another machine
        return None
    function.restype = None
    return cast("Callable[..., None]", function)


def _interpreted(
    step: ZeroCopy, nx: int, courses: Sequence[Course], keep: bool
) -> tuple[np.ndarray, np.ndarray]:
    n = max(c.h_s.size for c in courses)
    x, error = np.empty((n, nx, len(courses))), np.zeros((n, len(courses)))
    start, valve, h, p = step.arguments
    for lane, c in enumerate(courses):
        start[0], p[0] = c.x, c.p
        for k in range(n):
            if k < c.h_s.size:
                valve[0], h[0] = c.valve[k], c.h_s[k]
                step.evaluate()
                start[0], error[k, lane] = step.results[0][0], step.results[1][0, 0]
            x[k, :, lane] = start[0]
    return (x if keep else x[-1:]), error


@lru_cache(maxsize=1)
def _flags() -> tuple[str, ...]:
    """Return the compiler's flags: wide vectors where the processor has them (the results are the same)."""
    try:
        features = Path("/proc/cpuinfo").read_text(encoding="utf-8").split()
    except OSError:
        features = []
    return (*_FLAGS, "-mavx2") if "avx2" in features else _FLAGS
