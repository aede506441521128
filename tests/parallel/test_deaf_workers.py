"""Workers do not hear Ctrl-C from their first moment on: it is their parent's business.

In a process of its own each: what starts with the first workers of all has started already in this one.
"""

import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(
    not hasattr(signal, "pthread_sigmask"), reason="signals cannot be blocked here"
)

DEAF = """
import signal
def deaf(items):
    return [signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []) for _ in items]
"""
SWEEP = """
from deaf import deaf
from srs_opt.parallel import executor
from srs_opt.parallel.sweep import sweep
with executor(2) as where:
    print(all(sweep(deaf, range(6), chunk=1, where=where)))
"""
SPAWNED = """
from multiprocessing import get_context
from deaf import deaf
from srs_opt.interrupts import workers_deaf_to_interrupts
if __name__ == "__main__":
    with workers_deaf_to_interrupts():
        pool = get_context("spawn").Pool(2)
    print(all(flag for flags in pool.map(deaf, [[1]] * 6) for flag in flags), not deaf([1])[0])
    pool.terminate()
"""


@pytest.mark.parametrize(
    ("script", "told"), [(SWEEP, "True"), (SPAWNED, "True True")], ids=["loky", "spawned"]
)
def test_first_workers_are_deaf(script, told, tmp_path):
    (tmp_path / "deaf.py").write_text(DEAF)
    (tmp_path / "script.py").write_text(script)
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.stdout.split() == told.split(), done.stderr
