"""Maps of 4000 x 4000 cells: seconds of processor time to load, less than 1 GB, in a process of their own."""

import json
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from benchmarks.memory import OWN_PEAK

MEASURE = """
import json, sys, time
from planners.maze.load import load_maze
from planners.maze.field import DistanceField
begun = time.process_time()
maze = load_maze(sys.argv[1])
loaded = time.process_time() - begun
field = DistanceField.of(maze)
tabled = time.process_time() - begun - loaded
maze.point_clearances([(100.0 + i, 150.0 + i) for i in range(100)])
exact = time.process_time() - begun - loaded - tabled
peak = own_peak_kb() * 1024
nodes = field.values.size
print(json.dumps(dict(loaded=loaded, tabled=tabled, exact=exact, peak=peak, nodes=nodes)))
"""


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "fill"), [("map", 0.0001), ("yaml", 0.4), ("turned", 0.4)])
def test_large_maps(kind, fill, tmp_path):
    wall = np.random.default_rng(0).random((4000, 4000)) < fill
    if kind == "map":
        path = tmp_path / "m.map"
        rows = np.where(wall, ord("@"), ord(".")).astype(np.uint8)
        head = b"type octile\nheight 4000\nwidth 4000\nmap\n"
        path.write_bytes(head + b"\n".join(row.tobytes() for row in rows))
    else:
        path = tmp_path / "m.yaml"
        Image.fromarray(np.where(wall, 0, 255).astype(np.uint8)).save(tmp_path / "m.pgm")
        yaw = 0.3 if kind == "turned" else 0.0
        path.write_text(f"image: m.pgm\nresolution: 0.1\norigin: [0, 0, {yaw}]\n")
    run = subprocess.run(
        [sys.executable, "-c", OWN_PEAK + MEASURE, str(path)], capture_output=True, text=True, check=True
    )
    found = json.loads(run.stdout)
    assert found["loaded"] < 5
    assert found["tabled"] < 20
    assert found["exact"] < 20
    assert found["peak"] < 1e9
    assert found["nodes"] > 3_900_000
