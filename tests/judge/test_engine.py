"""The other engine's snake against mechanics that need no model: geometry, weights, sliding and rolling."""

import math
import sys

import numpy as np
import pytest

pytest.importorskip("dartpy", reason="the package 'dartpy' is not installed (extra judge)")

from dart_snake.bending import Lags, respond
from dart_snake.body import Body, Link, hinges_of
from dart_snake.engine import Snake
from dart_snake.walls import WallBox, wall_boxes

THREE = Body((Link(),) * 3, (0.037, 0.037), 0.012)


def still(steps: int, segments: int = 2) -> np.ndarray:
    return np.zeros((steps, segments))


def test_actuators_answer_a_step_with_both_time_constants():
    t = np.linspace(0, 0.6, 61)
    kappa, rate, end = respond(
        Lags.rest(1), np.array([0.2, 0.4]), np.array([[10.0], [-10.0]]), (0.08, 0.05), t
    )

    def step(t):  # the textbook's step response of two lags in series
        return np.where(t > 0, 1 - (0.08 * np.exp(-t / 0.08) - 0.05 * np.exp(-t / 0.05)) / 0.03, 0.0)

    np.testing.assert_allclose(kappa[:, 0], 10 * step(t) - 20 * step(t - 0.2), atol=1e-9)
    impulse = np.exp(-t / 0.08) - np.exp(-t / 0.05)
    np.testing.assert_allclose(rate[:20, 0], 10 * impulse[:20] / 0.03, atol=1e-9)
    assert end.curvature[0] == pytest.approx(kappa[-1, 0])


@pytest.mark.parametrize(("pairs", "error_m"), [(1, 4e-6), (2, 3e-7)])
def test_two_hinges_per_arc_place_the_next_link_as_the_arc_does(pairs, error_m):
    kappa = 19.0
    snake = Snake(THREE, pairs=pairs)
    m = snake.play(np.full((1, 2), kappa), still(1))
    bend = 0.037 * kappa
    chord = 0.012 / 2 * (1 + np.exp(1j * bend)) + (np.exp(1j * bend) - 1) / (1j * kappa)
    where = (m.x_m[0] + 1j * m.y_m[0]) * np.exp(-1j * m.theta_rad[0, 0])
    assert abs(where[1] - where[0] - chord) < error_m
    np.testing.assert_allclose(m.bend_rad, bend, atol=1e-9)


def test_hinges_add_up_to_the_straight_body():
    body = Body((Link(),) * 3, (0.037, 0.05), 0.012, gap_stiffness_n_m2=0.01)
    hinges, to_links = hinges_of(body, 2)
    assert sum(h.ahead_m for h in hinges) + to_links[-1] == pytest.approx(0.111)
    assert sum(h.share for h in hinges) == pytest.approx(2.0)


@pytest.mark.parametrize(("direction", "slides"), [(0.0, True), (math.pi / 2, False)])
def test_on_a_slope_it_rolls_along_and_stands_across(direction, slides):
    """A slope of 0.1 rad: rolling needs 0.043, the tyre holds 0.57; a wheel's spin takes a hundredth."""
    angle, seconds = 0.1, 0.3
    m = Snake(THREE, slope=(angle, direction)).play(still(300), still(300))
    went = m.x_m[-1, 1] if slides else m.y_m[-1, 1]
    down = 9.81 * (math.sin(angle) - 0.043) / 1.01
    assert went == pytest.approx(down * seconds**2 / 2 if slides else 0.0, rel=0.01, abs=1e-6)


def test_a_seized_wheel_slides_as_its_tyre_does():
    links = (Link(seized=True),) * 3
    m = Snake(Body(links, (0.037, 0.037), 0.012), slope=(0.7, 0.0)).play(still(200), still(200))
    down = 9.81 * (math.sin(0.7) - 0.57 * math.cos(0.7))
    assert m.x_m[-1, 1] == pytest.approx(down * 0.2**2 / 2, rel=0.02)


def test_a_loose_wheel_gives_way_by_its_play_alone():
    links = (Link(play_m=0.002),) * 3
    m = Snake(Body(links, (0.037, 0.037), 0.012), slope=(0.05, math.pi / 2)).play(still(200), still(200))
    assert m.y_m[-1, 1] == pytest.approx(0.002, abs=2e-4)


def test_a_soft_body_bends_like_a_beam():
    """A beam on two supports, a moment at one of them: its ends turn against each other by M l/(2 EI)."""
    pulled = Snake(
        Body((Link(tyre_friction=5.0),) * 2, (0.037,), 0.0, stiffness_n_m2=0.02),
        pull=lambda t, x, y, vx, vy: (0.0, 0.0, 1e-3),
    ).play(still(60, 1), still(60, 1))
    assert pulled.bend_rad[-1, 0] == pytest.approx(-1e-3 * 0.037 / (2 * 0.02), rel=0.01)


def test_a_wall_stops_the_body_and_is_seen_to():
    wall = WallBox(0.1, 0.0, 0.02, 0.3, 0.0)  # its face at 0.09, the body's end at 0.049 + 0.02
    m = Snake(THREE, slope=(0.3, 0.0), walls=[wall]).play(still(400), still(400))
    assert m.touched.any()
    assert m.x_m[-1, -1] == pytest.approx(0.07, abs=1e-3)
    assert not m.touched[m.x_m[:, -1] < 0.069].any()


def test_walls_are_boxes_whatever_their_outline():
    import shapely

    box = wall_boxes(shapely.box(0, 0, 0.4, 0.012))
    assert len(box) == 1
    assert {round(box[0].length_m, 6), round(box[0].width_m, 6)} == {0.4, 0.012}
    room = shapely.box(0, 0, 1, 1) - shapely.box(0.2, 0.2, 0.8, 0.8)
    shell = wall_boxes(room)
    assert len(shell) == 8
    made = shapely.union_all(
        [
            shapely.affinity.translate(
                shapely.affinity.rotate(
                    shapely.box(-b.length_m / 2, -b.width_m / 2, b.length_m / 2, b.width_m / 2),
                    b.heading_rad, use_radians=True, origin=(0, 0),
                ), b.x_m, b.y_m,
            )
            for b in shell
        ]
    )  # fmt: skip
    assert room.buffer(1e-9).contains(made)


def test_it_shares_nothing_with_what_it_judges():
    import ast
    from pathlib import Path

    root = Path(__file__).resolve().parents[2]
    found = set()
    for path in (root / "dart_snake").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                found.add(node.module.split(".")[0])
            elif isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
    assert found
    assert not found & {"srs_opt", "planners", "virtual_lab", "casadi"}
    judge = [p.read_text(encoding="utf-8") for p in (root / "srs_opt" / "judge").glob("*.py")]
    assert not [text for text in judge if "srs_opt.model." in text]
    assert sys.modules.get("dartpy")
