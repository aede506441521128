"""Worker processes and Ctrl-C: the interrupt is the parent's business, workers end with it in silence."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator


@contextlib.contextmanager
def workers_deaf_to_interrupts() -> Iterator[None]:
    """Start worker processes inside: they inherit a blocked SIGINT, which a terminal sends to all of a job.

    An interrupt that arrives meanwhile reaches this process at the end of the block.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
