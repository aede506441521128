"""Small data sets and tracks for the tests, made without the code under test where it matters."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from srs_opt.robot import wpi_srs

ROBOT = wpi_srs()
ROBOT_YAML = "name: WPI SRS\nlinks: 5\nrelative_sd: {friction_tangential: 0.05}\n"
HEADER = "trial,frequency_hz,pressure_kpa,offset,phase_lag_rad,heading_rad,duration_s\n"


def chain_points(kappa, *, l=0.037, gap=0.012, x=0.0, y=0.0, tail_heading=0.0):
    """Links' positions of one configuration, by walking along arcs in tiny straight steps."""
    points, heading = [(x, y)], tail_heading
    steps = 4000

    def straight(length):
        nonlocal x, y
        x, y = x + length * math.cos(heading), y + length * math.sin(heading)

    for k in kappa:
        straight(gap / 2)
        for _ in range(steps):
            heading += k * l / steps / 2
            straight(l / steps)
            heading += k * l / steps / 2
        straight(gap / 2)
        points.append((x, y))
    return np.array(points)


def gait_track(seconds=2.0, rate=120.0, speed=0.2, sd=1e-3, seed=0, links=5):
    """A wriggling row of markers that runs along x."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate)) / rate
    along = np.arange(links) * 0.049
    x = along + speed * time[:, None]
    y = (
        0.012
        * np.sin(2 * np.pi * 2 * time[:, None] + along / 0.049 * 1.57)
        * np.minimum(time, 0.3)[:, None]
        / 0.3
    )
    points = np.stack([x, y], axis=-1)
    return time, points + sd * rng.normal(size=points.shape)


def track_text(time, points):
    flat = points.reshape(len(time), -1)
    count = flat.shape[1] // 2
    names = [f"{a}{i}_m" for i in range(1, count + 1) for a in "xy"] if points.ndim == 3 else ["x_m", "y_m"]
    lines = [",".join(["time_s", *names])]
    lines += [
        ",".join([f"{t:.6f}", *("" if np.isnan(v) else f"{v:.5f}" for v in row)])
        for t, row in zip(time, flat)
    ]
    return "\n".join(lines) + "\n"


def write_set(folder: Path, trials=2, seconds=2.0, markers="tail_to_head") -> Path:
    """A small sound data set."""
    (folder / "trials").mkdir(parents=True)
    (folder / "robot.yaml").write_text(ROBOT_YAML)
    camera = "camera:\n  rate_hz: 120\n  marker_sd_m: 0.001\n"
    (folder / "dataset.yaml").write_text(f"name: small\nrobot: robot.yaml\n{camera}markers: {markers}\n")
    text = HEADER
    for i in range(1, trials + 1):
        time, points = gait_track(seconds, seed=i)
        points = points if markers == "tail_to_head" else points.mean(axis=1)
        (folder / "trials" / f"t{i}.csv").write_text(track_text(time, points))
        text += f"t{i},2,48,0,1.570796,0,{seconds}\n"
    (folder / "trials.csv").write_text(text)
    return folder


def add_bench(folder: Path) -> None:
    bench = folder / "bench"
    bench.mkdir()
    car = "direction,spring_n_m,car_mass_kg,deflection_m\n"
    (bench / "spring_car.csv").write_text(car + "tangential,5,0.1,0.0084\nnormal,50,0.1,0.0112\n")
    tow = "speed_m_s,force_n,with_tether\n"
    (bench / "tow.csv").write_text(tow + "0.1,0.06,yes\n0.2,0.07,yes\n0.1,0.05,no\n0.2,0.055,no\n")
    (bench / "checks.csv").write_text("quantity,value,sd\nruler_scale,1.01,0.002\n")
    rows = ["test,segment,condition,pressure_kpa,time_s,curvature_1_m"]
    for i in range(40):
        t = 0.02 * i
        k = 14.35 * (1 - (0.08 * math.exp(-t / 0.08) - 0.05 * math.exp(-t / 0.05)) / 0.03)
        rows.append(f"a,1,ground,41,{t:.3f},{k:.5f}")
    (bench / "steps.csv").write_text("\n".join(rows) + "\n")


def binomial_allows(hits: int, trials: int, rate: float) -> bool:
    """Whether the 99 % Clopper-Pearson interval of hits/trials holds `rate`."""
    from scipy.stats import binomtest

    interval = binomtest(hits, trials).proportion_ci(0.99, method="exact")
    return bool(interval.low <= rate <= interval.high)
