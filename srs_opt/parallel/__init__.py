"""Work handed out: to this process, to several here, or to a Dask cluster, with the same results."""

from srs_opt.parallel.executor import executor
from srs_opt.parallel.protocol import HERE, Executor, Shared, Work

__all__ = ["HERE", "Executor", "Shared", "Work", "executor"]
