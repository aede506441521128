"""A real local Dask cluster: loses a worker, has none, or is lost itself."""

import os
import signal
import subprocess
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from srs_opt.calibrate.run import calibrate
from srs_opt.errors import InputError, NoAnswerError
from srs_opt.measurement.dataset import load_dataset
from srs_opt.parallel import cluster as dask
from srs_opt.parallel import executor
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.draw import draw_truth
from virtual_lab.trials import small_design

ANSWERED = dask.answered


def set_patience(monkeypatch, **seconds):
    monkeypatch.setattr(dask, "CLUSTER", replace(dask.CLUSTER, **seconds))


def answered_unless_killed(mark, work, names, *rest):
    """The worker that is first asked for the fifth trial is killed."""
    if names[0] == "t05" and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return ANSWERED(work, names, *rest)


def local_cluster(workers):
    distributed = pytest.importorskip("distributed")
    return distributed.LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    )


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_worker_is_lost_and_the_calibration_has_the_same_bits(tmp_path, monkeypatch):
    truth = draw_truth((), np.random.default_rng(3))
    design = small_design(np.random.default_rng(4), 1.0)[:8]
    write_dataset(tmp_path / "set", truth, design, 5, Recording())
    dataset = load_dataset(tmp_path / "set")
    here = calibrate(dataset)
    mark = tmp_path / "killed"
    monkeypatch.setattr(dask, "answered", partial(answered_unless_killed, mark))
    with local_cluster(2) as cluster, executor(cluster=cluster.scheduler_address) as where:
        there = calibrate(dataset, where=where)
    assert mark.exists()
    assert there.parameters == here.parameters
    assert there.sd == here.sd


def test_no_scheduler_is_a_line(monkeypatch):
    set_patience(monkeypatch, connect_s=0.5)
    with (
        pytest.raises(InputError, match=r"no Dask scheduler answers there within 0\.5 s"),
        executor(cluster="127.0.0.1:1"),
    ):
        pass


@pytest.mark.filterwarnings("default")
def test_a_scheduler_without_workers_is_a_line(monkeypatch):
    set_patience(monkeypatch, workers_s=0.3)
    with (
        local_cluster(0) as cluster,
        pytest.raises(InputError, match=r"no worker, and none came within 0\.3 s; start one: dask worker"),
        executor(cluster=cluster.scheduler_address),
    ):
        pass


SCHEDULER = """
from distributed import LocalCluster
if __name__ == "__main__":
    cluster = LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, silence_logs=50,
        protocol="tcp", host="127.0.0.1",
    )
    print(cluster.scheduler_address, flush=True)
    input()
"""


def cubes_then_sleep(x):
    import time

    time.sleep(0.0 if x < 2 else 30.0)
    return x**3


@pytest.mark.filterwarnings("default")
def test_a_lost_scheduler_is_told(tmp_path):
    pytest.importorskip("distributed")
    (tmp_path / "scheduler.py").write_text(SCHEDULER)
    process = subprocess.Popen(
        [sys.executable, "scheduler.py"],
        cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    try:
        with executor(cluster=process.stdout.readline().strip()) as where:
            results = where.map(cubes_then_sleep, range(4))
            assert [next(results), next(results)] == [0, 1]
            process.kill()
            with pytest.raises(NoAnswerError, match="connection to the Dask scheduler was lost"):
                next(results)
    finally:
        process.kill()
        process.communicate()


@pytest.mark.filterwarnings("default")
def test_all_workers_lost_is_told(monkeypatch):
    set_patience(monkeypatch, workers_s=0.3, poll_s=0.1)
    with local_cluster(1) as cluster, executor(cluster=cluster.scheduler_address) as where:
        results = where.map(cubes_then_sleep, range(4))
        assert next(results) == 0
        cluster.scale(0)
        with pytest.raises(NoAnswerError, match="all workers were lost"):
            list(results)


def test_a_result_lost_with_its_worker_is_told(monkeypatch):
    """A result is ready, but nobody is left from whom it could be fetched."""
    distributed = pytest.importorskip("distributed")
    set_patience(monkeypatch, workers_s=0.0)
    monkeypatch.setattr(distributed, "wait", lambda tasks, timeout: None)

    class Alone:
        def nthreads(self):
            return {}

        def sync(self, function, callback_timeout):
            raise TimeoutError

    with pytest.raises(NoAnswerError, match="all workers were lost"):
        dask.Cluster(Alone(), "somewhere").results([None])
