"""The live page in a real browser: what it shows of a drive under way, and its stop button."""

import shutil
import subprocess

import pytest

from benchmarks.pilot import contest, virtual_pilot
from planners.pilot.page import LivePage

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        BROWSER is None, reason="no Chromium on this machine (Debian: apt-get install chromium)"
    ),
    pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler"),
]
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--virtual-time-budget=3000", "--dump-dom",
)  # fmt: skip


def test_the_page_shows_the_drive_and_its_button_stops_it(tmp_path, monkeypatch):
    arena = contest(1, 0.36)
    session = virtual_pilot(arena)
    seen = []
    with LivePage.serve(0, arena.problem, arena.plan, lambda text: None) as page:

        def watch(plant):
            page.show(plant)
            if plant.status.cycles == 6 and not seen:
                command = [BROWSER, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", page.address]
                done = subprocess.run(command, capture_output=True, text=True, timeout=120)
                seen.append(done.stdout)

        # the page's own script presses the button once it has drawn the robot
        press = "$('stop').onclick(); document.title = String(room && now.body.length);"
        press = f"setTimeout(() => {{ {press} }}, 1500);"
        from planners.pilot import page as module

        html = module.page_text().replace("look();\n</script>", f"look(); {press}\n</script>")
        monkeypatch.setattr(module, "page_text", lambda: html)
        driven = session.run(watch)
    assert driven.execution.reason == "stopped: the stop button was pressed"
    assert not session.world.controller.tick()[0].any()
    (dom,) = seen
    assert "driving, controller playing" in dom and "mm (estimated)" in dom
    assert dom.count('class="valve ') == 4
    title = dom.split("<title>")[1].split("</title>")[0]
    assert int(title) > 10  # points of the body
