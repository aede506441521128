"""Effects of one's own: registered, used in robot files and commands, never confused in caches."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from srs_opt.effects import plugins, register_effect
from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter, link
from srs_opt.errors import InputError
from srs_opt.gait import published_wave
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs

ROOT = Path(__file__).resolve().parents[2]
FILE = """
from srs_opt.effects import register_effect
from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter
register_effect(Effect("mud", "ground", (EffectParameter("damping", "N s/m", 0.1, lower=0),),
                       rolling_force=lambda e, v: {sign} * e["damping"] * v))
"""
SIZE = (EffectParameter("damping", "N s/m", 0.1, lower=0),)


@pytest.fixture
def registry(monkeypatch):
    """Forget what a test registers."""
    monkeypatch.setattr(plugins, "_own", {})
    yield
    monkeypatch.undo()


def test_registered_effect_equals_the_built_in_one_it_copies(registry):
    register_effect(Effect("my_rolling", "ground", SIZE, rolling_force=lambda e, v: -e["damping"] * v))
    gait = published_wave(wpi_srs()).gait()
    mine, known = (
        steady_gait(wpi_srs().with_values(effects=[{"name": name, "damping": 0.06}]), gait)
        for name in ("my_rolling", "viscous_rolling")
    )
    assert mine.speed_m_s == pytest.approx(known.speed_m_s, rel=1e-9)
    assert mine.speed_m_s < steady_gait(wpi_srs(), gait).speed_m_s


@pytest.mark.parametrize(
    ("name", "kind", "parameters", "words"),
    [
        ("stribeck", "ground", SIZE, "exists already"),
        ("My effect", "ground", SIZE, "lower-case"),
        ("mine", "weather", SIZE, "kind must be one of"),
        ("mine", "ground", (), "first parameter"),
        ("mine", "ground", (link(),), "first parameter"),
    ],
)
def test_impossible_effects_are_refused(registry, name, kind, parameters, words):
    with pytest.raises(InputError, match=words):
        register_effect(Effect(name, kind, parameters, rolling_force=lambda e, v: -v))


def test_same_name_with_another_definition_is_refused(registry):
    first = Effect("mine", "ground", SIZE, rolling_force=lambda e, v: -e["damping"] * v)
    register_effect(first)
    register_effect(first)
    with pytest.raises(InputError, match="another definition"):
        register_effect(Effect("mine", "ground", SIZE, rolling_force=lambda e, v: -2 * e["damping"] * v))


def simulate(folder: Path, sign: str) -> tuple[float, int]:
    """Run the command with mud of either sign; return its speed and the number of compiled models."""
    (folder / "mud.py").write_text(FILE.format(sign=sign), encoding="utf-8")
    robot = folder / "robot.yaml"
    robot.write_text("effects: [{name: mud, damping: 0.05}]\n", encoding="utf-8")
    cache = folder / "cache"
    environment = {**os.environ, "SRS_OPT_CACHE": str(cache)}
    command = [
        "-m",
        "srs_opt.simulate",
        "--plugin",
        folder / "mud.py",
        "--robot",
        robot,
        "--duration",
        "2",
        "--json",
        "--out",
        folder / "o",
    ]
    done = subprocess.run(
        [sys.executable, *map(str, command)],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)["speed_m_s"], len(list(cache.glob("*.so")))


def test_a_changed_definition_is_compiled_anew(tmp_path):
    slow, before = simulate(tmp_path, "-1")
    fast, after = simulate(tmp_path, "+1")
    assert fast > slow * 1.05
    assert after > before


def test_fingerprint_follows_the_definition(registry, monkeypatch):
    prints = set()
    for factor in (1, 2):
        monkeypatch.setattr(plugins, "_own", {})
        hook = {1: lambda e, v: -e["damping"] * v, 2: lambda e, v: -2 * e["damping"] * v}[factor]
        register_effect(Effect("mine", "ground", SIZE, rolling_force=hook))
        prints.add(wpi_srs().with_values(effects=[{"name": "mine", "damping": 0.1}]).fingerprint())
    assert len(prints) == 2


@pytest.mark.parametrize("content", [None, "this is not Python", "1/0"])
def test_bad_file_is_one_line(tmp_path, content):
    file = tmp_path / "effects.py"
    if content is not None:
        file.write_text(content, encoding="utf-8")
    robot = tmp_path / "robot.yaml"
    robot.write_text("effects: [{name: mud, damping: 0.05}]\n", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "srs_opt.simulate", "--plugin", str(file), "--robot", str(robot)],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "effects.py" in done.stderr
