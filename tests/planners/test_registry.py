"""One registry, one protocol: ours, OMPL's, and planners of one's own; with and without OMPL."""

import sys
from itertools import pairwise

import pytest
from planner_rooms import corridor

from planners.plan.certify import certify
from planners.plan.portfolio import PlanRequest, solve
from planners.plan.registry import OMPLS, OURS, Effort, planner_named, register_planner
from planners.search.ompl_problem import cycle_setup, gaits_of
from planners.search.ompl_setup import counted, seeded
from srs_opt.errors import InputError

EFFORT = Effort(300, 0, lambda: False)
FORWARD = register_planner("forward", lambda problem, effort: [0] * 8)


@pytest.fixture
def without_ompl(monkeypatch):
    for name in [name for name in sys.modules if name.split(".")[0] == "ompl"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "ompl", None)


@pytest.mark.parametrize("name", ["lattice", "runs", "fine", "rrt", "est", "kpiece1", "forward"])
def test_every_planner_is_a_planner_of_ompl_on_the_same_problem(problem_in, name):
    problem = problem_in(corridor(0.5))
    seeded(0)
    cycles = cycle_setup(problem)
    planner = planner_named(name).as_ompl(cycles, EFFORT)
    assert planner.getName() == name
    cycles.setup.setPlanner(planner)
    cycles.setup.setup()
    cycles.setup.solve(counted(300))
    assert cycles.setup.haveExactSolutionPath()
    path = cycles.setup.getSolutionPath()
    certificate = certify(problem, gaits_of(problem, path))
    assert certificate.passed
    # the objective is the duration here, counted in whole cycles
    objective, states = cycles.setup.getProblemDefinition().getOptimizationObjective(), path.getStates()
    spent = sum(objective.motionCost(a, b).value() for a, b in pairwise(states))
    assert 0 <= spent - certificate.time_s[-1] <= problem.motion.period_s.max() + 1e-9


@pytest.mark.parametrize("name", [*OURS, *OMPLS, "rs-bitstar", "kpiece", "dubins-fmt"])
def test_names(name):
    assert planner_named(name.upper()).name == name


@pytest.mark.parametrize("name", ["magic", "sst", "rs-", "dubins-est", "auto", "rs-aorrtc", "-rrt"])
def test_no_such_planner(name):
    with pytest.raises(InputError, match=r"expected auto .*, lattice, runs, fine.*rrt.*bitstar"):
        planner_named(name)


def test_a_planner_of_ones_own(problem_in):
    problem = problem_in(corridor(0.5))
    result = solve(problem, PlanRequest("forward"))
    assert result.plan.planner == "forward" and set(result.plan.gaits) == {0}
    with pytest.raises(InputError, match="taken"):
        register_planner("forward", FORWARD.search)
    for wrong in ([99], [], ["x"], 3):
        register = register_planner(f"wrong{len(str(wrong))}", lambda problem, effort, w=wrong: w)
        with pytest.raises(InputError, match="expected indices of gaits, 0 to 6"):
            register.find(problem, EFFORT)


def test_without_ompl(problem_in, without_ompl):
    problem = problem_in(corridor(0.5))
    assert solve(problem, PlanRequest()).plan.planner == "lattice"
    with pytest.raises(InputError, match="OMPL is not installed"):
        planner_named("rrt")
    assert solve(problem, PlanRequest("forward")).plan.planner == "forward"
