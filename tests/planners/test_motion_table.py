import dataclasses

import numpy as np
import pytest

from planners.motion.robots import undelayed
from planners.motion.store import _read, table_key, write_transitions
from srs_opt.geometry import points_in_room
from srs_opt.model.outline import centre_line_function
from srs_opt.orbit.body import integrator


def drive(robot, motion, order):
    """Simulate adaptively, a cycle each: yields (state before, gait before, gait, state after)."""
    run = integrator(robot)
    state, before = run.rest(), motion.rest
    for now in order:
        after = run.integrate(motion.joints.timeline(before, now), state).final
        yield state, before, now, after
        state, before = after, now


def cycle(motion, begin, before, speed, now):
    """Return poses over one cycle and the speed after it, by the table."""
    moved = motion.move(*begin[:3], before, speed)
    return moved.pose[now], moved.speed_m_s[now]


def test_predicts_a_cycle_to_millimetres(robot, gaits, motion):
    errors = []
    order = np.random.default_rng(1).integers(0, motion.size, 40).repeat(2)
    for state, before, now, after in drive(robot, motion, order):
        pose, speed = cycle(motion, state, before, state[3], now)
        off = np.hypot(*(pose[-1, :2] - after[:2])), abs(pose[-1, 2] - after[2]), abs(speed - after[3])
        errors.append(off)
    median, worst = np.median(errors, axis=0), np.max(errors, axis=0)
    assert median[0] < 0.001 and median[1] < 0.005 and median[2] < 0.003
    assert worst[0] < 0.012 and worst[1] < 0.06


def test_first_cycle_from_rest_is_exact(robot, gaits, motion):
    for state, before, now, after in drive(robot, motion, [0]):
        pose, speed = cycle(motion, state, before, 0.0, now)
        assert pose[-1] == pytest.approx(after[:3], abs=3e-4)
        assert speed == pytest.approx(after[3], abs=1e-3)


def test_steady_cycles_approach_the_orbit(gaits, motion):
    for index, entry in enumerate(gaits.gaits):
        pose, speed = np.zeros(3), 0.0
        before = motion.rest
        for _ in range(25):
            begin = pose
            moved, speed = cycle(motion, begin, before, speed, index)
            pose, before = moved[-1], index
        c, s = np.cos(begin[2]), np.sin(begin[2])
        dx, dy, turn = pose - begin
        local = [c * dx + s * dy, c * dy - s * dx, turn]
        assert local == pytest.approx(entry.displacement, abs=8e-3)


def test_moving_and_turning_the_start_moves_and_turns_the_cycle(motion):
    here = motion.move(0.0, 0.0, 0.0, 0, 0.3)
    there = motion.move(1.0, -2.0, 0.7, 0, 0.3)
    c, s = np.cos(0.7), np.sin(0.7)
    assert there.pose[..., 0] == pytest.approx(1.0 + c * here.pose[..., 0] - s * here.pose[..., 1])
    assert there.pose[..., 1] == pytest.approx(-2.0 + s * here.pose[..., 0] + c * here.pose[..., 1])
    assert there.speed_m_s == pytest.approx(here.speed_m_s)


def test_body_is_as_long_as_the_robot(robot, motion):
    lines = motion.bodies(motion.rest, slice(None), motion.move(0, 0, 0, motion.rest, 0.0).pose)
    length = np.hypot(*np.diff(lines, axis=-2).transpose(3, 0, 1, 2)).sum(axis=-1)
    assert length == pytest.approx(robot.length_m - robot.body_width_m, rel=2e-3)


def test_body_in_room_agrees_with_the_kinematics(robot):
    run = integrator(robot)
    kappa = np.array([5.0, -8.0, 3.0, 10.0])
    x, y = (np.asarray(v).ravel() for v in centre_line_function(run.structure, 1)(kappa, run.pack(0, 1)))
    placed = points_in_room(np.stack([x, y], axis=-1), np.array([0.2, 0.1, np.pi / 2]))
    assert placed[:, 0] == pytest.approx(0.2 - y)
    assert placed[:, 1] == pytest.approx(0.1 + x)


def test_course_of_backing_up_is_the_heading_not_the_travel(gaits, motion):
    assert abs(motion.course[motion.names.index("back")]) < 0.5
    assert motion.steady_speed_m_s[motion.names.index("back")] < 0


def test_stored_transitions_come_back(tmp_path, transitions):
    path = write_transitions(tmp_path / "t.npz", transitions)
    shape = transitions.kappa.shape[1::2]
    again = _read(path, *shape)
    assert again is not None
    assert again.pose == pytest.approx(transitions.pose, abs=1e-4)
    path.write_bytes(path.read_bytes()[:1000])
    assert _read(path, *shape) is None
    assert _read(tmp_path / "none.npz", *shape) is None


def test_key_knows_robot_and_gaits(robot, gaits):
    key = table_key(robot, gaits)
    fewer = dataclasses.replace(gaits, gaits=gaits.gaits[:-1])
    assert table_key(robot, fewer) != key
    assert table_key(robot.with_values(friction_normal=0.6), gaits) != key
    assert table_key(robot.with_values(name="other"), gaits) == key


def test_a_delay_only_shifts_the_plan(robot):
    late = robot.with_values(valve_delay_s=0.05, effects=[{"name": "dead_time", "delay_s": 0.03}])
    assert undelayed(late).valve_delay_s == 0
    assert undelayed(late).effects == ()
    assert undelayed(robot) is robot
