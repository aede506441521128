"""Ctrl-C and SIGTERM: as workers start, in foreign code that swallows exceptions, in steps not to be cut."""

from __future__ import annotations

import contextlib
import functools
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

Handler = Callable[[int, FrameType | None], Any]


@contextlib.contextmanager
def workers_deaf_to_interrupts() -> Iterator[None]:
    """Start worker processes inside: they inherit a blocked SIGINT, which a terminal sends to all of a job.

    An interrupt that arrives meanwhile reaches this process at the end of the block.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    from multiprocessing import resource_tracker  # here: every command imports this module

    # it watches over what workers share, and when it starts inside the block it ends the blocking
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def signals_not_lost() -> Iterator[None]:
    """Raise at the end of the block what Ctrl-C or SIGTERM raised inside, whatever became of it there.

    Solvers in C++ take an exception for a failed evaluation or a reason to stop, and return as if nothing
    had happened, or raise another.
    """
    raised: list[BaseException] = []

    def note(handler: Handler, number: int, frame: FrameType | None) -> None:
        try:
            handler(number, frame)
        except BaseException as error:
            raised.append(error)
            raise

    try:
        with _handled(note):
            yield
    finally:
        if raised:
            raise raised[0]


@contextlib.contextmanager
def signals_deferred() -> Iterator[Callable[[], bool]]:
    """Let Ctrl-C and SIGTERM take effect at the end of the block only.

    For steps of milliseconds that must not be cut in two, such as starting a process and knowing its number;
    and for foreign code that can be asked to stop but lets no exception through. What is given tells whether
    a signal is waiting.
    """
    came: list[Callable[[], None]] = []
    # the frame is let go: it holds what foreign code may have freed by then
    with _handled(lambda handler, number, frame: came.append(lambda: handler(number, None))):
        yield lambda: bool(came)
    if came:
        came[0]()


@contextlib.contextmanager
def _handled(instead: Callable[[Handler, int, FrameType | None], None]) -> Iterator[None]:
    """Handle Ctrl-C and SIGTERM by ``instead(handler, number, frame)``, where Python handles them at all."""
    if threading.current_thread() is not threading.main_thread():  # signals are the main thread's
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    ours = {number: handler for number, handler in before.items() if callable(handler)}
    try:
        for number, handler in ours.items():
            signal.signal(number, functools.partial(instead, handler))
        yield
    finally:
        for number, handler in ours.items():
            signal.signal(number, handler)
