"""The real robot as the driver sees it: cycles are ordered over the valve line, states come from the camera.

The controller plays every cycle once and then vents, unless the next one is ordered before the cycle ends. So
the driver must choose while the cycle is still being played: `play` returns a little before its end, with the
state in which the cycle will have ended.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from planners.drive.friction_ensemble import DEFAULT_ENSEMBLE
from planners.drive.plant import PlantStopped
from planners.motion.robots import undelayed, with_friction_times
from planners.pilot.observer import Latency, correct, straight_pose
from planners.pilot.pose import Camera, Sighting
from planners.pilot.protocol import Status
from planners.pilot.record import DriveLog
from planners.pilot.settings import PILOT
from planners.pilot.valve_line import Clock, ValveLine
from planners.plan.certify import clearances
from planners.search.problem import Problem
from srs_opt.controller.program import Program, events_of
from srs_opt.errors import NoAnswerError
from srs_opt.geometry import points_in_room
from srs_opt.measurement.chain import chain_of
from srs_opt.model.state import HEADING
from srs_opt.orbit.body import integrator
from srs_opt.simulate.integrate import Integrator, Trajectory
from srs_opt.simulate.shapes import centre_lines
from srs_opt.simulate.timeline import Timeline

Array = NDArray[np.float64]


class PilotedPlant:
    """A robot behind a valve line and a camera.

    Parameters
    ----------
    problem : Problem
        What was planned; its robot's model predicts the motion between sightings.
    program : Program
        What the controller holds: gait k of the table is its gait k.
    line : ValveLine
    camera : Camera
    clock : Clock
    log : DriveLog
        Keeps what was seen and played.
    tell : callable
        Takes messages for people.
    watch : callable
        Called with this object some 25 times a second while the robot moves.
    """

    waits = False

    def __init__(
        self,
        problem: Problem,
        program: Program,
        line: ValveLine,
        camera: Camera,
        clock: Clock,
        log: DriveLog,
        tell: Callable[[str], None] = lambda message: None,
        watch: Callable[[PilotedPlant], None] = lambda plant: None,
    ) -> None:
        self.robot = problem.robot
        self.run = Integrator(undelayed(problem.robot), problem.gaits.model)
        # the true robot's friction is not known: the motion is predicted with several, as the driver does
        self._runs = [
            integrator(undelayed(with_friction_times(problem.robot, *friction)), problem.gaits.model)
            for friction in DEFAULT_ENSEMBLE.frictions
        ]
        self._misfits = np.zeros(len(DEFAULT_ENSEMBLE.frictions))
        self._problem, self._program = problem, program
        self._line, self._camera, self._clock, self._log = line, camera, clock, log
        self._tell, self._shows = tell, watch
        self._chain = chain_of(problem.robot)
        self._heading = problem.start.heading
        self._seen: list[Sighting] = []
        self._returned_s = math.inf
        self._thinking_s = 0.0
        self.latency = Latency()
        self.lost = ""
        self.body = np.zeros((0, 2))  # centre line of the body now, in the room
        self.clearance_m = math.inf  # of the body now
        self.corrections: list[tuple[float, float]] = []  # offset (m) and residual (m) of every cycle
        self.state = self._resting_state()

    def play(self, timeline: Timeline, gait: int | None) -> Trajectory:
        """Order valves for the end of the present cycle; return shortly before their own end.

        Raises
        ------
        PlantStopped
            If the robot was vented on the way; `state` is then where it came to rest.
        """
        self._thinking_s = max(self._thinking_s, self._clock.now() - self._returned_s)
        self._returned_s = math.inf  # a robot at rest waits for the driver
        played, coasts = _split(timeline)
        try:
            motion = self._played(played, gait, coasts) if played.end_s else None
        except NoAnswerError as error:
            self._stop(str(error), may_go_on=self._line.status is not None)
        if coasts:
            motion = self._coast(timeline, motion)
        assert motion is not None  # a timeline is not empty
        if not coasts:
            self._returned_s = self._clock.now()
        return motion

    @property
    def status(self) -> Status | None:
        """The controller's last word."""
        return self._line.status

    @property
    def valves(self) -> Array:
        """S of every segment now, as ordered."""
        return self._log.states_at(self._clock.now(), self.robot.segments)

    def expect_decisions(self, seconds: float) -> None:
        """Say how long the driver will take between two cycles, until it is seen."""
        self._thinking_s = seconds

    def stop_now(self, reason: str) -> None:
        """Vent and end the drive; raises `PlantStopped`."""
        self._stop(reason, may_go_on=False)

    def stop(self) -> None:
        """Vent, as best as can be done; the controller does the same by itself when it hears nothing."""
        try:
            self._line.vent()
        except NoAnswerError as error:
            self._tell(f"warning: {error}; the controller vents by itself after its timeout")

    def _played(self, timeline: Timeline, gait: int | None, ends: bool) -> Trajectory:
        """Order one cycle, wait for it to begin and almost to end; return its motion as it will have been."""
        cycles = 0 if self._line.status is None else self._line.status.cycles
        if gait is None:
            tick_s = self._program.tick_s
            events, period = events_of(timeline, tick_s)
            pressure_pa = round(1e3 * float(timeline.pressure_kpa[-1]))  # a ramp ends there
            self._line.cycle(None, period, pressure_pa, events, self._program.words)
        else:
            self._line.select(gait, None)
        motions = [run.integrate(timeline, self.state) for run in self._runs]
        begin_s = self._wait_for_cycle(cycles)
        self._log.played(begin_s, timeline)
        lead_s = 0.0 if ends else min(self._lead_s(), PILOT.most_lead * timeline.end_s)
        end_s = begin_s + timeline.end_s - lead_s
        look_s = begin_s + PILOT.check_s
        while self._clock.now() < end_s:
            self._wait()
            if self._clock.now() > look_s:
                look_s += PILOT.check_s
                self._watch(motions[int(self._misfits.argmin())], begin_s)
        self._look()
        corrections = [correct(m, begin_s, self._seen, self.latency, self._chain) for m in motions]
        self._misfits = DEFAULT_ENSEMBLE.fading * self._misfits + [c.misfit for c in corrections]
        likely = int(self._misfits.argmin())
        motion, correction = motions[likely], corrections[likely]
        self.latency = correction.latency
        self.corrections.append((float(np.hypot(*correction.offset[:2])), correction.residual_m))
        motion = correction.apply(motion)
        self._heading = float(motion.final[HEADING])
        self.state = self._problem.as_planned(motion.final)
        return motion

    def _lead_s(self) -> float:
        """Return how long before a cycle's end the next one must be thought of."""
        return PILOT.least_lead_s + 2 * self._line.statistics.round_trip_s + 1.5 * self._thinking_s

    def _wait_for_cycle(self, cycles: int) -> float:
        """Wait until the ordered cycle begins; return when it did."""
        begun_s = self._clock.now()
        while True:
            status = self._line.status
            if status is not None and status.cycles > cycles and not status.has_pending:
                return self._line.time_of(status.time - status.tick)
            if self._clock.now() - begun_s > PILOT.begin_s:
                self._stop("the controller does not begin the cycle that it accepted", may_go_on=False)
            self._wait()

    def _wait(self) -> None:
        """Let a little time pass; take in what comes; stop when there is nothing to go by."""
        self._clock.sleep(PILOT.poll_s)
        try:
            self._line.poll()
        except OSError as error:  # the adapter was pulled out
            raise PlantStopped(f"the valve line is gone: {error}", may_go_on=False) from error
        self._camera.poll()
        if self._clock.now() - self._camera.last_arrived_s > PILOT.pose_lost_s:
            # Venting at once lets the body roll on and straighten, 0.3 m from full speed. The cycle is played
            # to its end instead, the model knows where that is, and the driver brakes where there is room.
            self.lost = f"no pose for {PILOT.pose_lost_s:g} s; halted and vented"

    def _look(self) -> None:
        """Take over what the camera has seen."""
        new = self._camera.take()
        self._log.seen(new)
        self._seen = [s for s in self._seen if s.time_s > self._clock.now() - PILOT.remembered_s] + new

    def _watch(self, motion: Trajectory, begin_s: float) -> None:
        """Stop where the robot strays, or where what is left of the cycle would touch a wall."""
        self._look()
        correction = correct(motion, begin_s, self._seen, self.latency, self._chain)
        if correction.seen < PILOT.least_sightings or self.lost:
            return
        left = motion.time_s > self._clock.now() - begin_s
        corrected = correction.apply(motion)
        at = np.searchsorted(motion.time_s, [self._clock.now() - begin_s]).clip(0, motion.time_s.size - 1)
        lines = points_in_room(centre_lines(self.run, motion.kappa[at]), corrected.pose[at])
        self.body, self.clearance_m = lines[0], float(clearances(self._problem, lines)[0])
        self._shows(self)
        off_m = float(np.hypot(*(corrected.pose - motion.pose)[-1, :2]))
        if off_m > PILOT.stray * self.robot.length_m:
            self._stop(f"strayed by {1e3 * off_m:.0f} mm from the predicted motion", may_go_on=True)
        if left.any():
            lines = points_in_room(centre_lines(self.run, motion.kappa[left]), corrected.pose[left])
            if float(clearances(self._problem, lines).min()) < PILOT.contact * self.robot.length_m:
                self._stop("a wall would have been touched within the cycle", may_go_on=True)

    def _coast(self, timeline: Timeline, motion: Trajectory | None) -> Trajectory:
        """Wait until the vented robot stands still; return the motion, ending where it was seen to rest."""
        before = self.state if motion is None else motion.final
        vent = timeline.part(slice(_last_push(timeline) + 1, None))
        coasting = self._runs[int(self._misfits.argmin())].integrate(vent, before)
        if motion is not None:
            coasting = motion.then(coasting)
        self._log.played(self._clock.now(), vent)
        self.state = self._rest()
        if self.lost:
            self.state = self._problem.as_planned(coasting.final)
        return coasting

    def _stop(self, reason: str, may_go_on: bool) -> None:
        """Vent, wait for rest where that can be seen, and tell the driver."""
        self.stop()
        vent = Timeline.vent(self.robot.segments, 1.0, 0.0)
        self._log.played(self._clock.now(), vent)
        self.state = self._rest()
        raise PlantStopped(reason, may_go_on)

    def _rest(self) -> Array:
        """Wait until the controller is vented and the robot stands still; return its state."""
        begun_s = look_s = self._clock.now()
        while self._clock.now() - begun_s < PILOT.longest_coast_s:
            self._wait()
            if self._clock.now() < look_s + PILOT.check_s:
                continue
            look_s = self._clock.now()
            self._look()
            status = self._line.status
            last = self._straight(self._clock.now() - PILOT.rest_s)
            most_m = PILOT.rest * self.robot.length_m
            still = len(last) > 3 and float(np.ptp(last[:, :2], axis=0).max()) < most_m
            if (
                status is not None
                and status.state == 0
                and (still or self.lost)
                and self._clock.now() - begun_s > PILOT.rest_s
            ):
                break
        return self.state if self.lost else self._resting_state()

    def _resting_state(self) -> Array:
        """Return the state of rest where the camera sees the robot: the median of its last looks."""
        begun_s = self._clock.now()
        while len(self._seen) < 5:
            self._clock.sleep(PILOT.poll_s)
            self._camera.poll()
            self._look()
            if self._clock.now() - begun_s > PILOT.first_pose_s:
                raise NoAnswerError(
                    f"no pose received within {PILOT.first_pose_s:g} s; check the camera's stream and --pose"
                )
        x, y, heading = np.median(self._straight(self._seen[-1].time_s - PILOT.rest_s), axis=0)
        return self._problem.as_planned(self.run.rest(float(x), float(y), float(heading)))

    def _straight(self, after_s: float) -> Array:
        """Return the poses (n, 3) that sightings after a time show, if the robot is straight."""
        found = [straight_pose(s, self._chain, self._heading) for s in self._seen if s.time_s > after_s]
        return np.array(found).reshape(-1, 3)


def _last_push(timeline: Timeline) -> int:
    """Return the last phase in which some chamber is supplied; -1 if there is none."""
    pushed = np.flatnonzero(timeline.valve.any(axis=0))
    return int(pushed[-1]) if pushed.size else -1


def _split(timeline: Timeline) -> tuple[Timeline, bool]:
    """Return the part up to the last push, and whether the valves are vented after it."""
    last = _last_push(timeline)
    return timeline.part(slice(0, last + 1)), last + 1 < timeline.duration_s.size
