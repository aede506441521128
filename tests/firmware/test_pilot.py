"""The pilot against the virtual snake: firmware, valve line and camera in the loop, on a virtual clock."""

import json
import shutil
import urllib.error
import urllib.request

import numpy as np
import pytest

from benchmarks.pilot import contest, drive_contest, virtual_pilot
from planners.drive.plant import PlantStopped
from planners.pilot import protocol
from planners.pilot.observer import Latency, correct, straight_pose
from planners.pilot.page import LivePage
from planners.pilot.plant import PilotedPlant
from planners.pilot.pose import Camera, Report, Sighting, parse_report
from planners.pilot.protocol import Command, Fault
from planners.pilot.record import DriveLog
from planners.pilot.session import connect, pilot
from planners.plan.program import plan_program
from srs_opt.calibrate.run import calibrate
from srs_opt.controller.c_source import write_program
from srs_opt.controller.program import Program
from srs_opt.errors import InputError
from srs_opt.measurement.chain import chain_of, link_positions
from srs_opt.measurement.dataset import load_dataset
from srs_opt.orbit.body import integrator
from srs_opt.robot import wpi_srs
from srs_opt.simulate.timeline import Timeline
from virtual_lab.controller import Controller
from virtual_lab.truth import Truth

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


@pytest.fixture(scope="module")
def arena():
    return contest(1, 0.36)  # a short braided maze: 21 cycles


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 3])
def test_contest_mazes_are_driven_through_firmware_and_line_without_contact(seed):
    row = drive_contest(seed, 0.36)
    assert row["reached"] and row["true_clearance_m"] > 0
    assert row["estimate_error_m"] < 0.003  # of the clearance: what the pilot believes is what is so
    assert row["latency_s"] == pytest.approx(0.03, abs=0.008)


@pytest.mark.slow
def test_a_robot_with_a_hose_arrives_or_stops_but_does_not_touch():
    row = drive_contest(1, 0.36, Truth(effects=({"name": "tether_drag", "force_n": 0.035},)))
    assert row["true_clearance_m"] > 0


def test_a_plan_runs_by_itself_as_it_was_planned(arena, tmp_path):
    program = plan_program(arena.problem, arena.plan)
    controller = Controller(write_program(program, tmp_path / "plan_program.h"))
    controller.receive(protocol.frame(Command.RUN, 1))
    before = (arena.problem.motion.rest, *arena.plan.gaits)
    cycles = [arena.problem.joints.timeline(a, b) for a, b in zip(before, arena.plan.gaits)]
    wanted = Timeline.join(cycles)
    ends = np.cumsum(wanted.duration_s)
    played = np.array([controller.tick()[0] for _ in range(300 + round(ends[-1] / 1e-3))])[300:]
    at = np.searchsorted(ends, (np.arange(len(played)) + 0.5) * 1e-3)
    np.testing.assert_array_equal(played, wanted.valve[:, at].T)
    assert controller.fault == Fault.OK  # the dwell guard had nothing to do
    assert not controller.tick()[0].any()


def test_a_lost_pose_vents_before_anything_is_touched(arena):
    session = virtual_pilot(arena)
    world = session.world

    def blinder(plant):
        if plant.status.cycles > 6:
            world.blind = True

    driven = session.run(blinder)
    assert not driven.execution.reached and "no pose for 0.25 s" in driven.execution.reason
    world.sleep(2.0)
    assert not world.controller.tick()[0].any()
    assert session.true_clearance_m() > 0


def test_the_stop_button_vents(arena):
    session = virtual_pilot(arena)
    with LivePage.serve(0, arena.problem, arena.plan, lambda text: None) as page:
        base, token = page.address.split("/#")
        assert "STOP" in urllib.request.urlopen(base + "/").read().decode()
        assert json.load(urllib.request.urlopen(base + "/room.json"))["maze"]["rings"]
        for headers in ({"X-Pilot": "guess"}, {"X-Pilot": token, "Host": "evil.example"}):
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(urllib.request.Request(base + "/stop", b"", headers))

        def press(plant):
            page.show(plant)
            if plant.status.cycles == 4:
                urllib.request.urlopen(urllib.request.Request(base + "/stop", b"", {"X-Pilot": token}))

        driven = session.run(press)
        state = json.load(urllib.request.urlopen(base + "/state.json"))
    assert state["stopped"] and len(state["body"]) > 10 and len(state["valves"]) == 4
    assert driven.execution.reason == "stopped: the stop button was pressed"
    assert not session.world.controller.tick()[0].any()


def test_an_interrupt_vents(arena):
    session = virtual_pilot(arena)

    def interrupt(plant):
        if plant.status.cycles == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        session.run(interrupt)
    session.world.sleep(0.02)
    assert not session.world.controller.tick()[0].any()


def test_a_robot_that_lies_elsewhere_or_holds_other_gaits_is_not_started(arena):
    start = arena.problem.start
    session = virtual_pilot(arena, start=(start.x + 0.05, start.y, start.heading))
    with pytest.raises(InputError, match="move it there, or plan from its position: --start"):
        session.run(lambda plant: None)
    table = arena.problem.gaits
    fewer = Program.of_table(
        type(table)(table.robot_name, table.fingerprint, table.model, table.gaits[:5]), 1e-3
    )
    with pytest.raises(InputError, match="flash this table's header"):
        connect(session.world, session.world, fewer)


@pytest.mark.slow
def test_the_drive_becomes_a_data_set_that_calibrates(arena, tmp_path):
    from planners.pilot.record import write_dataset

    session = virtual_pilot(arena)
    driven = session.run(lambda plant: None)
    folder = write_dataset(driven.log, tmp_path / "set", arena.problem.robot, driven.latency.value_s)
    (trial,) = load_dataset(folder).trials
    assert trial.time_s[0] == pytest.approx(0, abs=0.02) and np.abs(trial.markers_m[0, 0]).max() < 0.004
    assert trial.applied.time_s[0] == 0 and set(np.unique(trial.applied.state)) <= {-1, 0, 1}
    # the recorded valves, played on the model, take the robot where the camera saw it
    found = calibrate(load_dataset(folder))
    assert found.after < 2.0  # of the noise, over a whole drive
    for name in ("friction_tangential", "friction_normal", "curvature_per_pressure_1_m_kpa"):
        assert found.parameters[name] == pytest.approx(getattr(wpi_srs(), name), rel=0.06)


def test_the_observer_finds_offset_drift_and_latency():
    robot = wpi_srs()
    chain, run = chain_of(robot), integrator(wpi_srs(), "complex")
    gait = contest(1, 0.36).problem.gaits.gaits[0].gait
    motion = run.integrate(Timeline.of_gait(gait, gait.period_s), run.rest())
    rng = np.random.default_rng(1)
    offset, drift, late = np.array([0.004, -0.003, 0.05]), np.array([0.03, 0.01, -0.1]), 0.03
    sightings = []
    for at in np.arange(0.01, 0.45, 0.01):
        pose, kappa = motion.at(np.array([at]))
        q = np.concatenate([pose[0] + offset + drift * at, kappa[0]])
        markers = link_positions(chain, q) + 0.001 * rng.standard_normal((5, 2))
        markers[rng.random(5) < 0.1] = np.nan
        sightings.append(Sighting(100.0 + at + late, None, markers))
    found = correct(motion, 100.0, sightings, Latency(0.025, 0.01), chain)
    assert found.latency.value_s == pytest.approx(late, abs=0.004)
    assert np.all(np.abs(found.offset - offset) < [1e-3, 1e-3, 0.012])
    end = found.apply(motion).final[:3]
    truth = motion.final[:3] + offset + drift * motion.time_s[-1]
    assert np.all(np.abs(end - truth) < [2e-3, 2e-3, 0.02])


@pytest.mark.parametrize("heading", [0.3, 3.3, -7.0])
def test_a_straight_robot_is_placed_with_markers_missing(heading):
    chain = chain_of(wpi_srs())
    markers = link_positions(chain, np.array([1.0, 2.0, heading, 0, 0, 0, 0]))
    markers[[0, 3]] = np.nan
    pose = straight_pose(Sighting(0.0, None, markers), chain, heading + 0.2)
    np.testing.assert_allclose(pose, [1.0, 2.0, heading], atol=1e-12)


def test_stamps_of_another_clock_are_put_on_the_pilots():
    class Source:
        def poll(self):
            return [Report(10.0 + 0.1 * k + wait, 500.0 + 0.1 * k, np.zeros(3), None) for k, wait in waits]

    waits = [(0, 0.05), (1, 0.02), (2, 0.3)]
    camera = Camera(Source())
    camera.poll()
    times = [s.time_s for s in camera.take()]
    assert times[1] == pytest.approx(10.12) and times[2] == pytest.approx(10.22)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("not json", "expected JSON"),
        ("[1, 2]", "expected an object"),
        ('{"x_m": 1, "y_m": 2}', "as numbers"),
        ('{"x_m": 1, "y_m": 2, "heading_rad": NaN}', "as numbers"),
        ('{"x_m": 1e9, "y_m": 2, "heading_rad": 0}', "as numbers"),
        ('{"t_s": "now", "x_m": 1, "y_m": 2, "heading_rad": 0}', "expected seconds"),
        ('{"markers_m": [[0, 0]]}', "expected 5 places"),
        ('{"markers_m": [[0, 0], [1], null, null, null]}', r"markers_m\[1\]"),
    ],
)
def test_malformed_poses_are_told(line, words):
    with pytest.raises(InputError, match=words):
        parse_report(line, 0.0, 5)


def test_a_plant_stop_says_whether_another_way_may_be_tried():
    assert PlantStopped("lost", may_go_on=False).may_go_on is False
    assert PilotedPlant.waits is False
    assert isinstance(DriveLog().sightings, list) and callable(pilot)
