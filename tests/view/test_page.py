"""The interactive page: true to its data, self-contained, and alive in a real browser."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from planners.plan.__main__ import main as plan
from planners.view.__main__ import main as view
from planners.view.page import read_motion, save_page
from srs_opt.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
needs_browser = pytest.mark.skipif(
    BROWSER is None, reason="no Chromium on this machine (Debian: apt-get install chromium)"
)
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND", "--enable-logging=stderr", "--window-size=900,900",
)  # fmt: skip


@pytest.fixture(scope="module")
def driven(tmp_path_factory) -> Path:
    """A maze planned and driven: the folder with motion.json and plan.json."""
    folder = tmp_path_factory.mktemp("plan")
    assert plan([str(ROOT / "mazes/first.yaml"), "--execute", "--quiet", "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def page(driven) -> Path:
    assert view([str(driven), "--quiet", "--out", str(driven)]) == 0
    return driven / "view.html"


def test_motion_is_that_of_the_plan(driven):
    motion = read_motion(driven / "motion.json")
    record = json.loads((driven / "plan.json").read_text(encoding="utf-8"))
    planned, drive = motion["runs"]
    assert planned["duration_s"] == pytest.approx(record["duration_s"], abs=1e-4)
    assert len(planned["cycles"]) == sum(s["cycles"] for s in record["steps"])
    path = {p["t_s"]: (p["x_m"], p["y_m"]) for p in record["path"]}
    ends = [path[min(path)], path[max(path)]]
    assert np.array(planned["centre"])[[0, -1]] * 1e-4 == pytest.approx(np.array(ends), abs=2e-4)
    assert drive["outcome"] == record["execution"]["reason"]
    # the command's value may be a lower bound, the page's instants may miss the very smallest
    assert min(drive["clearance_mm"]) >= 1e3 * record["execution"]["smallest_clearance_m"] - 0.1


def test_body_keeps_its_length_and_clearance_is_exact(driven):
    """An oracle of our own: distances from the drawn body to the drawn walls and bounds."""
    import shapely

    motion = read_motion(driven / "motion.json")
    walls = shapely.union_all([shapely.LinearRing(ring) for ring in motion["maze"]["rings"]])
    xmin, ymin, xmax, ymax = motion["maze"]["bounds"]
    for body, mm in list(zip(motion["runs"][1]["body"], motion["runs"][1]["clearance_mm"]))[::20]:
        line = shapely.LineString(np.reshape(body, (-1, 2)) * 1e-4)
        assert line.length == pytest.approx(4 * 0.049, rel=5e-3)
        x0, y0, x1, y1 = line.bounds
        free = min(line.distance(walls), x0 - xmin, y0 - ymin, xmax - x1, ymax - y1) - 0.02
        assert mm == pytest.approx(min(1e3 * free, 100), abs=0.6)


def test_page_needs_nothing_else(page):
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"https?://", text)
    assert not re.search(r"<link|<script[^>]+src|@import|url\(", text)


def test_names_cannot_break_the_page(driven, tmp_path):
    motion = read_motion(driven / "motion.json")
    motion["maze"]["name"] = "</script><script>alert(1)</script>"
    text = save_page(motion, tmp_path / "view.html").read_text(encoding="utf-8")
    assert "<script>alert" not in text
    assert json.loads(re.search(r'application/json">(.*)</script>', text)[1]) == motion


@pytest.mark.parametrize(
    "change",
    [{"version": 1}, {"runs": []}, {"runs": [{"name": "planned"}]}, {"body_width_m": "wide"}],
    ids=lambda change: next(iter(change)),
)
def test_other_files_are_refused_in_one_line(driven, tmp_path, change):
    motion = json.loads((driven / "motion.json").read_text(encoding="utf-8")) | change
    file = tmp_path / "motion.json"
    file.write_text(json.dumps(motion), encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(str(file))) as caught:
        read_motion(file)
    assert "\n" not in str(caught.value)


def browse(page: Path, script: str, folder: Path, fragment: str = "") -> dict:
    """Open the page in a browser, run `script` and return what it puts into `report`.

    A browser without a screen may draw no frame at all while its clock is virtual: frames come from a timer
    of that same clock, so that what the page does between frames does not depend on the machine's load.
    """
    frames = """<script>window.requestAnimationFrame = draw => setTimeout(() => draw(performance.now()), 16);
    window.cancelAnimationFrame = clearTimeout;</script>"""
    probe = f"""<script>window.onerror = m => {{ document.title = JSON.stringify({{error: m}}); }};
    const finish = report => {{ document.title = JSON.stringify(report); }};
    {script}</script>"""
    copy = folder / "probed.html"
    html = page.read_text(encoding="utf-8")
    html = html.replace("<head>", "<head>" + frames, 1).replace("</body>", probe + "</body>")
    copy.write_text(html, encoding="utf-8")
    done = subprocess.run(
        [BROWSER, *FLAGS, f"--user-data-dir={folder / 'profile'}", "--virtual-time-budget=4000",
         "--dump-dom", f"{copy.as_uri()}{fragment}"],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert "Uncaught" not in done.stderr, done.stderr
    title = re.search(r"<title>(.*?)</title>", done.stdout, re.DOTALL)
    assert title, done.stderr[-2000:]
    return json.loads(title[1].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&"))


@needs_browser
def test_page_opens_at_a_time_and_shows_it(page, tmp_path):
    report = browse(
        page,
        """const pen = $("room").getContext("2d"), {width, height} = pen.canvas;
        const all = pen.getImageData(0, 0, width, height).data, seen = new Set();
        for (let i = 0; i < all.length; i += 4) seen.add(all.slice(i, i + 3).join());
        finish({clock: $("clock").textContent, now: $("now").textContent, colours: seen.size,
                runs: [...$("run").options].map(o => o.value)});""",
        tmp_path,
        "#t=2.5",
    )
    assert report["clock"].startswith("2.50 /")
    assert re.match(r"cycle \d+ of \d+: gait .* Hz, .* kPa; clearance", report["now"])
    assert report["runs"] == ["planned", "driven"]
    assert report["colours"] > 3  # walls, floor, goal, body


@needs_browser
def test_play_pause_scrub_and_keys(page, tmp_path):
    report = browse(
        page,
        """const seconds = () => parseFloat($("clock").textContent), report = {before: seconds()};
        const press = key => document.dispatchEvent(new KeyboardEvent("keydown", {key}));
        $("play").click(); report.label = $("play").textContent;
        setTimeout(() => {
          $("play").click(); report.after = seconds();
          $("scrub").value = 0.5; $("scrub").dispatchEvent(new Event("input")); report.half = seconds();
          press("ArrowRight"); report.key = seconds();
          $("run").value = "planned"; $("run").dispatchEvent(new Event("change")); report.run = run.name;
          go(1e9); report.end = seconds(); report.last = run.duration_s;
          finish(report);
        }, 500);""",
        tmp_path,
    )
    assert report["before"] == 0
    assert report["label"] == "Pause"
    assert report["after"] == pytest.approx(0.5, abs=0.1)
    assert report["key"] == pytest.approx(report["half"] + 0.1, abs=0.011)
    assert report["run"] == "planned"
    assert report["end"] == pytest.approx(report["last"], abs=0.01)


@needs_browser
def test_a_press_on_the_clearance_goes_there_and_no_two_gaits_share_a_colour(page, tmp_path):
    report = browse(
        page,
        """const canvas = $("clearance"), box = canvas.getBoundingClientRect();
        canvas.setPointerCapture = () => {};
        const press = (name, share, buttons) => canvas.dispatchEvent(new PointerEvent(name, {
          clientX: box.left + LEFT + share * (canvas.clientWidth - LEFT), clientY: box.top + 5, buttons}));
        const place = () => time / run.duration_s, report = {gaits: motion.gaits.length};
        press("pointerdown", 0.25, 1); report.pressed = place();
        press("pointermove", 0.75, 1); report.dragged = place();
        press("pointermove", 0.5, 0); report.hovered = place();
        report.colours = new Set(motion.gaits.map((gait, k) => colour(k))).size;
        report.names = [...document.querySelectorAll("#names > span")].map(name => name.textContent);
        report.wide = document.documentElement.scrollWidth <= window.innerWidth;
        finish(report);""",
        tmp_path,
    )
    assert report["pressed"] == pytest.approx(0.25, abs=0.01)
    assert report["dragged"] == report["hovered"] == pytest.approx(0.75, abs=0.01)
    assert report["colours"] == report["gaits"] == len(report["names"])
    assert report["wide"]


def test_the_drawn_clearance_is_that_of_the_page(driven, tmp_path, monkeypatch):
    """The certificate's own numbers are lower bounds where those suffice; what is drawn has no such steps."""
    import planners.view.picture as picture
    from planners.plan.certify import clearances

    drawn = []
    monkeypatch.setattr(
        picture, "clearances", lambda *given: drawn.append(clearances(*given)) or drawn[-1].copy()
    )
    assert plan([str(ROOT / "mazes/first.yaml"), "--quiet", "--out", str(tmp_path)]) == 0
    page_mm = read_motion(driven / "motion.json")["runs"][0]["clearance_mm"]
    assert 1e3 * min(drawn[0]) == pytest.approx(min(page_mm), abs=1.0)


@needs_browser
def test_occupancy_maps_are_drawn(driven, tmp_path):
    """A map of cells is drawn where its cells are: one dark cell in the lower left quarter."""
    import base64
    import io

    from PIL import Image

    motion = read_motion(driven / "motion.json")
    cells = Image.new("LA", (2, 2), (0, 0))
    cells.putpixel((0, 1), (0x3A, 255))
    stream = io.BytesIO()
    cells.save(stream, "PNG")
    picture = base64.b64encode(stream.getvalue()).decode()
    motion["maze"] |= {
        "rings": [], "goal": None, "bounds": [0, 0, 2, 2],
        "cells": {"png": picture, "origin": [0, 0, 0], "size": [2, 2]},
    }  # fmt: skip
    page = save_page(motion, tmp_path / "view.html")
    report = browse(
        page,
        """setTimeout(() => {
          const pen = $("room").getContext("2d"), w = pen.canvas.width, h = pen.canvas.height;
          const side = h, left = (w - side) / 2;
          const dot = (x, y) => pen.getImageData(Math.round(x), Math.round(y), 1, 1).data[0];
          const at = (u, v) => dot(left + u * side, (1 - v) * side);
          finish({corner: at(0.1, 0.1), above: at(0.1, 0.9), right: at(0.95, 0.1)});
        }, 500);""",
        tmp_path,
    )
    assert report == {"corner": 0x3A, "above": 255, "right": 255}
