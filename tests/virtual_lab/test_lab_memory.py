"""What segments remember goes on where an integration is taken up again."""

import numpy as np

from benchmarks.discrepancy_payoff import FRAMES, play, trial_of
from srs_opt.gait import Wave
from virtual_lab.live import LiveRobot
from virtual_lab.simulate import run
from virtual_lab.truth import Truth

HYSTERESIS = Truth(effects=({"name": "hysteresis", "ratio": 0.5, "width": 4.0},))


def test_cycles_played_one_by_one_are_those_played_at_once():
    gait = Wave.uniform(4, 2.0, 50.0, np.pi / 2, 0.2).gait()
    whole = run(HYSTERESIS, trial_of(gait), gait.period_s * np.arange(1, 4)).centre_of_mass()
    back = 1.5 * 0.049 + 0.5 * 0.049  # from the straight robot's centre of mass to its tail
    found = play(HYSTERESIS, [gait] * 3, (back, 0.0, 0.0)).centre[FRAMES - 1 :: FRAMES]
    np.testing.assert_allclose(found, whole, atol=1e-6)


def test_a_live_robot_remembers_how_it_was_bent():
    whole, pieces = LiveRobot(HYSTERESIS), LiveRobot(HYSTERESIS)
    valves = np.array([1.0, -1.0, 0.0, 1.0])
    for robot, count in ((whole, 1), (pieces, 10)):
        for sign in (1, -1):
            for _ in range(count):
                robot.advance(sign * valves, 50.0, 0.3 / count)
    np.testing.assert_allclose(pieces.look().kappa, whole.look().kappa, atol=1e-6)
