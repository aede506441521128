"""The choice of who does the work."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from srs_opt.parallel.protocol import HERE, Executor


@contextlib.contextmanager
def executor(jobs: int = 1, cluster: str | None = None) -> Iterator[Executor]:
    """Open what takes work: this process, `jobs` processes, or a Dask cluster.

    Parameters
    ----------
    jobs : int
        Processes on this machine, this one included.
    cluster : str, optional
        Address of a Dask scheduler, ``host:port``, that gets everything instead.

    Raises
    ------
    InputError
        If no scheduler answers there, or none that has workers.
    """
    if cluster is not None:
        from srs_opt.parallel.cluster import opened

        with opened(cluster) as there:
            yield there
    elif jobs > 1:
        from srs_opt.parallel.processes import Processes

        with Processes(jobs) as several:
            yield several
    else:
        yield HERE
