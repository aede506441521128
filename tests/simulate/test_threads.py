"""The same answers from several threads at once as from one."""

import os
import subprocess
import sys

import pytest

# in a process of its own: a fault here can end the process, and its caches must start empty
PROGRAM = """
import sys
from concurrent.futures import ThreadPoolExecutor
import numpy as np
from srs_opt.gait import Wave
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs

random = np.random.default_rng(5)
gaits = [
    Wave.uniform(4, *random.uniform([1, 41, 1, 0], [2, 55, 2, 0.3])).gait()
    for _ in range(int(sys.argv[1]))
]

def answer(gait):
    orbit = steady_gait(wpi_srs(), gait, sys.argv[2])
    return (*orbit.envelope_m, orbit.speed_m_s, orbit.turn_rate_rad_s)

with ThreadPoolExecutor(4) as pool:
    together = list(pool.map(answer, gaits))
wrong = [k for k, gait in enumerate(gaits) if answer(gait) != together[k]]
assert not wrong, wrong
print(len(set(together)), "gaits agree")
"""


@pytest.mark.parametrize(("count", "compiler"), [(100, None), (3, "none")], ids=["compiled", "interpreted"])
def test_steady_gaits_of_threads_equal_those_of_one(count, compiler):
    environment = {**os.environ, **({"SRS_OPT_CC": compiler} if compiler else {})}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(count), "complex"],
        capture_output=True, text=True, timeout=300, env=environment, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{count} gaits agree\n"
