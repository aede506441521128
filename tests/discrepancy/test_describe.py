"""What is in no list, described by a term of the grammar; and where a gap is said to be."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.discrepancy_baselines import baselines
from srs_opt.calibrate.candidates import Candidate, fitted_coordinates
from srs_opt.calibrate.experiment import Experiment
from srs_opt.calibrate.forms import Form
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.noise import noise_of
from srs_opt.discrepancy import describe, pipeline
from srs_opt.discrepancy.__main__ import main
from srs_opt.discrepancy.describe import describe_gap, terms_of
from srs_opt.discrepancy.locate import stages
from srs_opt.discrepancy.pipeline import diagnose
from srs_opt.discrepancy.search import Search
from srs_opt.discrepancy.settings import DESCRIPTION
from srs_opt.discrepancy.split import split_trials
from srs_opt.effects import all_effects, generic_effects
from srs_opt.measurement.dataset import load_dataset
from srs_opt.robot import load_robot
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.trials import small_design
from virtual_lab.truth import Truth

FEW = ("generic_along_link", "generic_across_body", "generic_load_link")  # compiled in seconds


@pytest.fixture
def few_terms(monkeypatch):
    few = {name: generic_effects()[name] for name in FEW}
    for module in ("srs_opt.calibrate.model", "srs_opt.discrepancy.describe"):
        monkeypatch.setattr(f"{module}.generic_effects", lambda: few)


def lab_set(folder, unlisted, trials=8):
    design = small_design(np.random.default_rng(1), 1.5)[:trials]
    write_dataset(folder, Truth(unlisted=unlisted), design, 3, Recording(rate_hz=40.0))
    return load_dataset(folder)


def describe_set(folder, unlisted, trials):
    dataset = lab_set(folder, unlisted, trials)
    split = split_trials(dataset.trials)
    experiment = Experiment(Model(dataset.robot), dataset.trials, noise_of(dataset), dataset.bench)
    search = Search(experiment, fitted_coordinates(dataset.robot), (), split.open)
    null = search.calibrate()
    return null, describe_gap(search, null, null, split.sealed)


def test_a_wheel_that_rolls_hard_is_described_by_the_command(tmp_path, few_terms, monkeypatch):
    """The listed effects, here one, fail; the answer, the report and the robot file hold the term."""
    listed = (Candidate(Form(all_effects()["head_mass"])),)
    monkeypatch.setattr("srs_opt.discrepancy.pipeline._candidates", lambda *_: listed)
    lab_set(tmp_path / "set", ({"name": "stiff_wheel", "excess": 5.0, "link": 2},))
    found = []
    monkeypatch.setattr(pipeline, "diagnose", lambda *a, **k: found.append(diagnose(*a, **k)) or found[0])
    out = tmp_path / "out"
    assert main([str(tmp_path / "set"), "--quiet", "--jobs", "1", "--out", str(out)]) == 0
    said = json.loads((out / "discrepancy.json").read_text(encoding="utf-8"))
    assert (said["verdict"], said["believed"]) == ("described", True)
    assert said["described"].startswith("link 2 rolls ")
    (effect,) = said["effects"]
    assert (effect["name"], effect["parameters"]["link"]) == ("generic_along_link", 2)
    assert abs(effect["parameters"]["excess"] - 5.0) < 4 * effect["sd"]["excess"]
    assert said["gap"]["ratio"] < 0.1
    assert said["located"][0]["where"] == "curvature to motion (ground), link 2"
    following = said["next_experiment"]
    assert following["separates"][0] == said["described"] and following["expected_power"] > 0.9
    assert following["what"].endswith("turn its wheels by hand one after the other")
    robot = load_robot(out / "described_robot.yaml")
    assert robot.effects[0]["excess"] == pytest.approx(effect["parameters"]["excess"])
    assert "link 2 rolls" in (out / "report.html").read_text(encoding="utf-8")
    said = baselines(found[0])  # what simpler methods say of the same set, with the listed effects
    assert set(said) == {"nearest_shape", "forward_aic", "sparse_regression"}


def test_nothing_is_described_where_nothing_is_missing(tmp_path, few_terms):
    _, found = describe_set(tmp_path / "set", (), trials=4)
    assert "chance" in found.why_not


def test_terms_stand_at_every_place_but_where_the_robot_has_them():
    labels = {c.label for c in terms_of(5, ["generic_along_link[2]"])}
    assert {"generic_along_link[1]", "generic_gain_segment[4]", "generic_moment"} <= labels
    assert not {"generic_along_link[2]", "generic_gain_segment[5]"} & labels
    assert DESCRIPTION.refits < len(labels)


def fitted(misfit, *candidates):
    fit = SimpleNamespace(misfit_ratio=misfit)
    return SimpleNamespace(fit=fit, candidates=candidates, deviance=1000 * misfit, parameters=len(candidates))


def test_located_is_what_closes_the_gap_when_fitted():
    effects = generic_effects()
    rolling = Candidate(Form(effects["generic_along_link"], 2))
    soaking, lens = (
        Candidate(Form(effects["generic_moment"])),
        Candidate(Form(effects["generic_camera_lens"])),
    )
    null = fitted(5.0)
    said = stages(null, [null, fitted(1.1, rolling), fitted(4.0, soaking), fitted(2.5, lens)])
    assert [p.where for p in said] == ["curvature to motion (ground), link 2", "camera"]
    assert said[0].score == pytest.approx(3900)
    assert not stages(null, [fitted(4.0, soaking)])


def explaining(name, deviance, misfit=1.0):
    candidate = Candidate(Form(generic_effects()[name]))
    fit = SimpleNamespace(misfit_ratio=misfit, variance_inflation=1.0, off_bench={}, point=None)
    return SimpleNamespace(candidates=(candidate,), label=candidate.label, deviance=deviance, fit=fit)


@pytest.mark.parametrize(("behind", "why"), [(200.0, ""), (5.0, "does about as well")])
def test_look_alikes_that_leave_only_noise_are_told_apart_by_all_trials(monkeypatch, behind, why):
    """Load or friction across the wheels that changes with curvature: on the first seconds both fit."""
    load = explaining("generic_load_curvature", 1000.0)
    across = explaining("generic_across_curvature", 1000.0 + behind)
    by_label = {h.label: h for h in (load, across)}
    monkeypatch.setattr(describe, "_fitted", lambda *_: [across, load])
    monkeypatch.setattr(describe, "open_seal", lambda *_: SimpleNamespace(ratio=0.01))
    search = SimpleNamespace(
        fit=lambda c, p: by_label[c[0].label], candidates=range(80), experiment=0, seed=0
    )
    null = SimpleNamespace(deviance=9000.0)
    listed = SimpleNamespace(candidates=(), label="no effect", deviance=8000.0, fit=fitted(1.6).fit)
    found = describe.describe(search, null, listed, ())
    assert found.best is load and found.why_not.endswith(why) and bool(found.why_not) == bool(why)
