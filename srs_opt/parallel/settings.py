"""How long a Dask cluster is waited for, and in which pieces it gets work."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ClusterSettings:
    """Patience with a scheduler and its workers.

    Attributes
    ----------
    connect_s : float
        Within which a scheduler has to answer.
    workers_s : float
        Within which a scheduler has to have a worker, at the start and when all were lost. Shorter: a cluster
        that is being restarted counts as lost; longer: a mistake in the setting up is told later.
    poll_s : float
        Between two looks whether there are workers.
    gather_s : float
        For fetching results that are ready; then it is looked again whether there are workers.
    items_per_task : int
        Enough to fill the lanes of compiled code; more leave workers idle at the end.
    pieces_per_thread : int
        Submitted in advance: with one, workers wait for the next; many are kept in memory.
    """

    connect_s: float = 10.0
    workers_s: float = 30.0
    poll_s: float = 5.0
    gather_s: float = 30.0
    items_per_task: int = 4
    pieces_per_thread: int = 3


CLUSTER = ClusterSettings()
