"""Calibration on a real local Dask cluster that loses a worker: the same bits as in this process."""

import os
import signal
from functools import partial

import pytest

from srs_opt.calibrate import cluster as on_cluster
from srs_opt.calibrate.run import calibrate
from srs_opt.measurement.dataset import load_dataset
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.draw import draw_truth
from virtual_lab.trials import small_design

LINEARISE = on_cluster._linearise


def linearise_but_die_once(mark, setup, trials, *rest):
    """The worker that is first asked for the third trial is killed."""
    if trials[0].name == "t05" and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return LINEARISE(setup, trials, *rest)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_cluster_loses_a_worker_and_calibrates_to_the_same_bits(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    import numpy as np

    truth = draw_truth((), np.random.default_rng(3))
    design = small_design(np.random.default_rng(4), 1.0)[:8]
    write_dataset(tmp_path / "set", truth, design, 5, Recording())
    dataset = load_dataset(tmp_path / "set")
    here = calibrate(dataset)
    mark = tmp_path / "killed"
    monkeypatch.setattr(on_cluster, "_linearise", partial(linearise_but_die_once, mark))
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        there = calibrate(dataset, cluster=cluster.scheduler_address)
    assert mark.exists()
    assert there.parameters == here.parameters
    assert there.sd == here.sd
