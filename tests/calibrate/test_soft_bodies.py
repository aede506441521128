"""Calibration of bodies that bend under load, data from the laboratory's own formulation."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from srs_opt.calibrate.candidates import Candidate, fitted_coordinates
from srs_opt.calibrate.experiment import Experiment
from srs_opt.calibrate.fit import fit, start_point
from srs_opt.calibrate.forms import Form
from srs_opt.calibrate.instruments import check_expectations
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.result import bench_warnings
from srs_opt.calibrate.run import calibrate
from srs_opt.discrepancy.search_settings import SCREEN
from srs_opt.discrepancy.soft_start import soft_start
from srs_opt.effects import all_effects
from srs_opt.errors import InputError
from srs_opt.measurement.dataset import load_dataset
from srs_opt.robot import wpi_srs
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.trials import Trial
from virtual_lab.truth import Parameters, Scatter, Truth

EI = 0.006
GAITS = ((2.0, 55.0, 0.4, 1.571), (1.5, 41.0, 0.0, 1.571), (1.0, 48.0, -0.4, 0.9))
COMPLIANCE = all_effects()["bending_compliance"]


def recorded(folder, stiffness_n_m2, gaits=GAITS):
    truth = Truth(
        Parameters(bending_stiffness_n_m2=stiffness_n_m2, bending_relaxation_s=0.007),
        scatter=Scatter(0.0, 0.0, 0.0),
        friction_speed_m_s=0.001,
    )
    trials = [Trial(f"t{k}", f, p, o, lag, duration_s=1.5) for k, (f, p, o, lag) in enumerate(gaits)]
    return load_dataset(write_dataset(folder / "set", truth, trials, 3, Recording(rate_hz=60)))


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("lab"), EI)


def with_robot(dataset, **changes):
    return dataclasses.replace(dataset, robot=wpi_srs().with_values(**changes))


def test_a_stiffness_with_a_deviation_is_found(dataset):
    own = {"bending_stiffness_n_m2": 0.0052, "bending_relaxation_s": 0.005}
    sd = {"bending_stiffness_n_m2": 0.2, "bending_relaxation_s": 0.5}
    found = calibrate(with_robot(dataset, **own, relative_sd=sd))
    assert found.parameters["bending_stiffness_n_m2"] == pytest.approx(EI, rel=0.02)
    assert found.parameters["bending_relaxation_s"] == pytest.approx(0.007, rel=0.1)
    assert found.after < 1.05
    assert found.robot.sources["bending_stiffness_n_m2"] == "calibrated"


def test_a_stiffness_without_a_deviation_stays(dataset):
    names = [c.name for c in fitted_coordinates(wpi_srs().with_values(bending_stiffness_n_m2=0.005))]
    assert "bending_stiffness_n_m2" not in names


def test_the_effect_makes_a_rigid_robot_soft(dataset):
    rigid = with_robot(dataset)
    experiment = Experiment(Model(rigid.robot), dataset.trials, 0.001)
    base = fitted_coordinates(rigid.robot)
    candidate = Candidate(Form(COMPLIANCE))
    start = start_point((*base, *candidate.coordinates))
    start.values["bending_compliance.flexibility"] = 70.0
    found = fit(experiment, (*base, *candidate.coordinates), start)
    assert 1 / found.point.values["bending_compliance.flexibility"] == pytest.approx(EI, rel=0.02)
    assert not bench_warnings(found.off_bench)


@pytest.mark.parametrize("leap", SCREEN.soft_start_sizes)
def test_a_fit_begins_near_the_softness_that_the_body_has(tmp_path, leap):
    candidate = Candidate(Form(COMPLIANCE))
    flexibility = leap * candidate.sizes[0].typical
    rigid = with_robot(recorded(tmp_path, 0.95 / flexibility, GAITS[:1]))
    experiment = Experiment(Model(rigid.robot), rigid.trials, 0.001)
    base = fitted_coordinates(rigid.robot)
    alone = SimpleNamespace(fit=SimpleNamespace(coordinates=base, point=start_point(base)))
    start = soft_start(experiment, base, candidate, alone, rigid.trials)
    assert start.values["bending_compliance.flexibility"] == flexibility


def test_rigid_models_do_without_the_stiffness():
    soft = wpi_srs().with_values(bending_stiffness_n_m2=0.005)
    assert Model(soft).structure({})[0].model == "compliant"
    assert Model(soft, "complex").structure({})[0].model == "complex"
    flexible = {"bending_compliance.flexibility": 100.0}
    assert Model(wpi_srs()).structure(flexible)[0].model == "compliant"
    assert Model(wpi_srs(), "simplified").structure(flexible)[0].model == "simplified"
    with pytest.raises(InputError, match="rigid"):
        Model(wpi_srs(), "compliant")


def test_a_flexibility_can_be_read_on_the_bench():
    robot = wpi_srs().with_values(bending_stiffness_n_m2=0.01, gap_stiffness_n_m2=0.002)
    reads = check_expectations(Model(robot))["bending_flexibility_1_n_m2"]
    series = 1 / 0.01 + 0.012 / (0.037 * 0.002)
    assert reads({}) == pytest.approx(series)
    assert reads({"bending_compliance.flexibility": 40.0}) == pytest.approx(series + 40)
    assert check_expectations(Model(wpi_srs()))["bending_flexibility_1_n_m2"]({}) == pytest.approx(
        0, abs=1e-9
    )


def test_warnings_count_the_bench_deviations():
    assert bench_warnings({"tau1_s": 2.9, "friction_normal": -10.2})[0].startswith(
        "friction_normal lies 10.2 standard deviations below"
    )
    assert np.size(bench_warnings({"tau1_s": 3.0})) == 0
