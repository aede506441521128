"""Worker processes and Ctrl-C: the interrupt is the parent's business, workers end with it in silence."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType


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
def interrupt_not_lost() -> Iterator[None]:
    """Raise KeyboardInterrupt at the end of the block if Ctrl-C came inside and was swallowed there.

    Solvers in C++ take an interrupt for a failed evaluation or a reason to stop, and return as if nothing
    had happened.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    came = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal came
        came = True
        before(number, frame)

    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if came:
        raise KeyboardInterrupt
