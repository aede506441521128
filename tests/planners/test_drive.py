import numpy as np
import pytest
from planner_rooms import corridor, gate, maze_of

from planners.drive.contact import BodyWatch
from planners.drive.execute import execute
from planners.drive.reference import reference_of
from planners.plan.answer import Plan
from planners.plan.certify import certify
from planners.plan.solve import solve_with_lattice
from planners.search.track import Learned
from srs_opt.errors import InputError
from srs_opt.simulate.integrate import Integrator


@pytest.fixture(scope="module")
def driven(problem_in):
    problem = problem_in(corridor(0.3, 2.0))
    return problem, solve_with_lattice(problem).plan


def test_arrives_without_touching(driven):
    problem, plan = driven
    execution = execute(problem, plan)
    assert execution.reached and execution.collisions == 0
    assert execution.smallest_clearance_m > 0
    assert execution.final_error_m == 0
    assert problem.goal.reached(*map(float, execution.pose[-1]))


@pytest.mark.parametrize(
    "changes",
    [
        {"friction_tangential": 0.043 * 1.2, "friction_normal": 0.57 * 1.2},
        {"friction_tangential": 0.043 * 0.8, "friction_normal": 0.57 * 0.8},
        {"effects": [{"name": "tether_drag", "force_n": 0.02}]},
        {"effects": [{"name": "segment_bias", "bias": 1.0, "segment": 2}]},
    ],
    ids=["rough", "smooth", "tether", "bias"],
)
def test_other_robots_arrive_or_stop_saying_so(driven, robot, changes):
    problem, plan = driven
    execution = execute(problem, plan, robot.with_values(**changes))
    assert execution.collisions == 0
    assert execution.reached or execution.reason.startswith("stopped")


def test_a_robot_that_cannot_move_stops_and_says_so(driven, robot):
    problem, plan = driven
    stuck = execute(problem, plan, robot.with_values(curvature_per_pressure_1_m_kpa=1e-4))
    assert not stuck.reached and stuck.collisions == 0
    assert "stopped" in stuck.reason
    assert stuck.final_error_m > 0.5


def test_other_robot_with_other_segments_is_refused(driven, robot):
    problem, plan = driven
    with pytest.raises(InputError, match="7 links"):
        execute(problem, plan, robot.with_values(links=7))


def test_contact_is_seen_on_the_body_not_on_a_point(problem_in, robot):
    """The centre of mass is far from the wall; the tail is not."""
    problem = problem_in(maze_of((0, 0, 1.0, 0.3), (0.3, 0.15, 0.0), (0.8, 0.15, 0.05), []))
    run = Integrator(robot)
    still = np.zeros((2, robot.segments))
    reach = robot.length_m / 2
    for gap, touched in ((0.001, False), (-0.001, True)):
        watch = BodyWatch(problem, robot, run)
        watch.look(np.array([0.0, 0.1]), np.array([[reach + gap, 0.15, 0.0]] * 2), still)
        assert watch.touched == touched
        assert watch.smallest_m == pytest.approx(max(gap, 0.0), abs=1e-6) or touched


def test_planned_through_a_gap_that_is_not_there_contact_is_counted(problem_in, gaits):
    """A plan for a wide gate driven in a maze with a closed one: the watch must see the wall."""
    open_problem = problem_in(gate(0.3))
    plan = solve_with_lattice(open_problem).plan
    closed = problem_in(gate(0.03))
    execution = execute(closed, Plan("lattice", plan.gaits, certify(open_problem, plan.gaits)))
    assert not execution.reached
    assert execution.collisions == 1 or execution.reason.startswith("stopped")
    assert execution.to_record()["collisions"] == execution.collisions


def test_learns_stretch_and_drift():
    learned = Learned()
    predicted, period = np.array([0.2, 0.01, 0.0]), 0.5
    for _ in range(40):
        believed = learned.apply(np.linspace([0, 0, 0], predicted, 17)[None], np.array([period]))[0, -1]
        learned = learned.update(believed, np.array([0.16, 0.008, 0.05]), period, 0, 0.236)
    assert learned.stretches(2)[0] == pytest.approx(0.8, abs=0.02)
    assert learned.stretches(2)[1] == learned.stretch  # what one gait does beyond the others stays its own
    assert learned.drift_rad_s == pytest.approx(0.1, abs=0.01)


def test_reference_ends_beyond_the_goal(driven):
    problem, plan = driven
    reference = reference_of(problem, plan)
    assert reference.left_s[0] == pytest.approx(plan.duration_s)
    assert reference.left_s[-1] < 0
    assert np.all(np.diff(reference.left_s) < 0)
