"""The live page: map, body, plan, clearance, valves and a stop button, served on this machine alone."""

from __future__ import annotations

import json
import secrets
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from planners.plan.answer import Plan
from planners.search.problem import Problem
from planners.view.record import maze_record
from srs_opt.errors import InputError

if TYPE_CHECKING:
    from planners.pilot.plant import PilotedPlant

MOST_WAY = 2000  # points of the way that are shown
HOSTS = ("127.0.0.1", "localhost")


def page_text() -> str:
    """Return the page's HTML."""
    return resources.files("planners.pilot").joinpath("live.html").read_text(encoding="utf-8")


class LivePage:
    """What the page shows, and whether its stop button was pressed.

    Attributes
    ----------
    address : str
        Empty when nothing is served.
    """

    def __init__(self, problem: Problem, plan: Plan) -> None:
        self.address = ""
        self._names = [entry.name for entry in problem.gaits.gaits]
        self._token = secrets.token_urlsafe(16)
        self._stop = threading.Event()
        self._way: list[list[float]] = []
        room = {
            "maze": maze_record(problem.maze),
            "plan": np.round(plan.certificate.pose[::10, :2], 4).tolist(),
            "body_width_m": problem.robot.body_width_m,
        }
        self.room = json.dumps(room)
        self.state = json.dumps(self._record("waiting for the robot", None))

    @staticmethod
    @contextmanager
    def serve(
        port: int | None, problem: Problem, plan: Plan, say: Callable[[str], None]
    ) -> Iterator[LivePage]:
        """Serve the page while the context lasts; with no port, only keep what it would show.

        Raises
        ------
        InputError
            If the port cannot be had.
        """
        page = LivePage(problem, plan)
        if port is None:
            yield page
            return
        try:
            server = ThreadingHTTPServer(("127.0.0.1", port), page._handler())
        except (OSError, OverflowError) as error:
            raise InputError(f"--page {port}: {error}") from error
        server.daemon_threads = True
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)
        thread.start()
        page.address = f"http://127.0.0.1:{server.server_port}/#{page._token}"
        say(f"live page: {page.address}")
        try:
            yield page
        finally:
            server.shutdown()
            server.server_close()

    def show(self, plant: PilotedPlant) -> None:
        """Take over what the plant knows; pass the stop button on to it."""
        if plant.body.size:
            self._way = [*self._way, np.round(plant.body.mean(axis=0), 4).tolist()][-MOST_WAY:]
        self.state = json.dumps(self._record("stopped" if self._stop.is_set() else "driving", plant))
        if self._stop.is_set():
            plant.stop_now("the stop button was pressed")

    def _record(self, state: str, plant: PilotedPlant | None) -> dict[str, Any]:
        status = None if plant is None else plant.status
        joining = "joining cycle" if status is not None and status.cycles else ""
        gait = joining if status is None or status.gait is None else self._names[status.gait]
        return {
            "state": state if status is None else f"{state}, controller {status.state.name.lower()}",
            "gait": gait,
            "pressure_kpa": 0.0 if status is None else 1e-3 * status.pressure_pa,
            "valves": [] if plant is None else plant.valves.tolist(),
            "clearance_mm": None if plant is None else round(1e3 * plant.clearance_m, 2),
            "latency_s": 0.0 if plant is None else plant.latency.value_s,
            "body": [] if plant is None else np.round(plant.body, 4).tolist(),
            "way": self._way,
            "stopped": self._stop.is_set(),
        }

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        page = self

        class Handler(BaseHTTPRequestHandler):
            """Answers three addresses; a page elsewhere must not be able to press the button."""

            def do_GET(self) -> None:
                """Send the page, the room or the state."""
                path = self.path.split("?")[0]
                if self._is_foreign():
                    self.send_error(403)
                elif path == "/":
                    self._send(page_text(), "text/html; charset=utf-8")
                elif path in ("/room.json", "/state.json"):
                    self._send(page.room if path == "/room.json" else page.state, "application/json")
                else:
                    self.send_error(404)

            def do_POST(self) -> None:
                """Press the stop button."""
                token = self.headers.get("X-Pilot", "")
                if self._is_foreign() or not secrets.compare_digest(token.encode(), page._token.encode()):
                    self.send_error(403)
                elif self.path != "/stop":
                    self.send_error(404)
                else:
                    page._stop.set()
                    self._send("{}", "application/json")

            def _is_foreign(self) -> bool:
                return (self.headers.get("Host") or "").rsplit(":", 1)[0] not in HOSTS

            def _send(self, text: str, kind: str) -> None:
                data = text.encode()
                self.send_response(200)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(data)))
                self.send_header("Cache-Control", "no-store")
                self.end_headers()
                self.wfile.write(data)

            def log_message(self, format: str, *args: Any) -> None:
                """Keep the terminal for the drive."""

        return Handler
