"""Sweeps give the same results wherever they run, go on where they stopped, and survive a lost worker."""

import os
import signal
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from srs_opt.gait_map import grid
from srs_opt.gait_map.grid import grid_points, map_at
from srs_opt.parallel import executor
from srs_opt.parallel.sweep import Resume, sweep
from srs_opt.robot import wpi_srs

NUMBERS = [k / 7 for k in range(40)]


def third_powers(chunk):
    return [[x**3, float("nan") if x > 5 else x / 3] for x in chunk]


def counted(log, chunk):
    with Path(log).open("a") as stream:
        stream.write("x")
    return third_powers(chunk)


def test_chunks_come_in_order_whatever_runs_them():
    alone = list(sweep(third_powers, NUMBERS, chunk=7))
    assert len(alone) == 40
    with executor(jobs=2) as where:
        assert repr(alone) == repr(list(sweep(third_powers, NUMBERS, chunk=7, where=where)))
    assert list(sweep(third_powers, [], chunk=7)) == []


def test_an_interrupted_sweep_goes_on(tmp_path):
    log, kept = tmp_path / "log", Resume(tmp_path / "kept", "powers")
    started = sweep(partial(counted, log), NUMBERS, chunk=5, resume=kept)
    for _ in range(12):  # into the third chunk
        next(started)
    started.close()
    assert len(log.read_text()) == 3
    results = list(sweep(partial(counted, log), NUMBERS, chunk=5, resume=kept))
    assert len(log.read_text()) == 8
    assert repr(results) == repr(list(sweep(third_powers, NUMBERS, chunk=5)))


@pytest.mark.parametrize("damage", [b"", b"[1, 2", b"[[1]]", b"\xff\xfe", b"{}"])
def test_a_damaged_chunk_is_computed_again(tmp_path, damage):
    kept = Resume(tmp_path / "kept", "powers")
    right = list(sweep(third_powers, NUMBERS, chunk=5, resume=kept))
    sorted(kept.folder.iterdir())[0].write_bytes(damage)
    assert repr(list(sweep(third_powers, NUMBERS, chunk=5, resume=kept))) == repr(right)


def test_other_work_is_not_mistaken_for_this(tmp_path):
    log = tmp_path / "log"
    for key in ("one robot", "another"):
        list(sweep(partial(counted, log), NUMBERS, chunk=40, resume=Resume(tmp_path / "kept", key)))
    assert len(log.read_text()) == 2


def test_an_interrupted_map_gives_the_same_bits(tmp_path, monkeypatch):
    points = grid_points(list(np.linspace(1, 2, 10)), [41.0, 50.0], [0.0, 0.3], [1.2])
    monkeypatch.setattr(grid, "_CHUNK", 16)
    whole = map_at(wpi_srs(), "complex", points)
    solve, done = grid.map_points, []

    def interrupted(robot, model, chunk):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(chunk)
        return solve(robot, model, chunk)

    monkeypatch.setattr(grid, "map_points", interrupted)
    with pytest.raises(KeyboardInterrupt):
        map_at(wpi_srs(), "complex", points, resume=tmp_path / "kept")
    assert len(list((tmp_path / "kept").iterdir())) == 2
    monkeypatch.setattr(grid, "map_points", lambda *a: done.append(0) or solve(*a))
    resumed = map_at(wpi_srs(), "complex", points, resume=tmp_path / "kept")
    assert done.count(0) == 1
    assert np.array_equal(resumed.rows, whole.rows, equal_nan=True)


def map_but_die_once(mark, chunk):
    """The map's work; the first worker to take the third chunk is killed."""
    if chunk[0][0] > 1.4 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return grid.map_points(wpi_srs(), "complex", chunk)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_cluster_loses_a_worker_and_gives_the_same_bits(tmp_path):
    """Two worker processes of a real cluster, one killed in mid-run; compared with this process."""
    distributed = pytest.importorskip("distributed")
    points = grid_points(list(np.linspace(1, 2, 10)), [41.0, 50.0, 55.0], [0.2], [1.2])
    points.sort()
    here = np.array(grid.map_points(wpi_srs(), "complex", points[:6]))
    mark = tmp_path / "killed"
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as cluster,
        executor(cluster=cluster.scheduler_address) as where,
    ):
        found = np.array(list(sweep(partial(map_but_die_once, mark), points, chunk=6, where=where)))
    assert mark.exists()
    expected = [grid.map_points(wpi_srs(), "complex", points[k : k + 6]) for k in range(0, 30, 6)]
    assert np.array_equal(found, np.concatenate([np.array(e) for e in expected]), equal_nan=True)
    assert np.array_equal(found[:6], here, equal_nan=True)
