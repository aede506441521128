"""One suite over everything that is registered, a plugin's effect included."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from effect_lab import PLUGIN, small_set

from srs_opt.calibrate.candidates import fitted_coordinates
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit import start_point
from srs_opt.calibrate.forms import Form, form_of_entry, forms_of
from srs_opt.calibrate.instruments import check_expectations
from srs_opt.calibrate.model import Conditions, Model
from srs_opt.calibrate.run import calibrate
from srs_opt.effects import all_effects, built_in, plugins
from srs_opt.effects.effect import HOOKS
from srs_opt.effects.parameter import Component
from srs_opt.measurement.dataset import load_dataset
from srs_opt.measurement.instruments import INSTRUMENTS
from srs_opt.measurement.records import Trial
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.plugins import load_plugin
from srs_opt.robot import load_robot, save_robot, wpi_srs
from virtual_lab.catalogue import LISTED

OWN = "my_rolling"
NAMES = [*built_in(), OWN]
DISSIPATING = [n for n in NAMES if n == OWN or built_in()[n].kind in ("tether", "ground")]
GAIT = Conditions(50.0, 2.0)


@pytest.fixture(scope="module", autouse=True)
def plugin(tmp_path_factory):
    before = dict(plugins._own)
    file = tmp_path_factory.mktemp("plugin") / "mud_plugin.py"
    file.write_text(PLUGIN)
    load_plugin(file)
    assert all_effects()[OWN].kind == "ground"
    yield
    plugins._own.clear()
    plugins._own.update(before)


def entry_of(name, share=1.0):
    effect = all_effects()[name]
    found = {p.name: p.typical for p in effect.parameters}
    found[effect.size.name] = share * effect.size.typical
    if effect.place:
        found[effect.place.name] = 2
    return {"name": name, **found}


@pytest.mark.parametrize("name", NAMES)
def test_it_says_what_it_is_and_what_to_look_at(name):
    effect = all_effects()[name]
    assert effect.what and effect.look and effect.hooks <= set(HOOKS)
    assert effect.instrument is None or effect.instrument in INSTRUMENTS.all()


@pytest.mark.parametrize("name", NAMES)
def test_absent_at_size_zero(name):
    model, plain = Model(wpi_srs().with_values(effects=[entry_of(name, 0.0)])), Model(wpi_srs())
    assert Structure.of(model.robot) == Structure.of(wpi_srs())
    zero = {c.name: 0.0 for f in model.forms if f.effect.name == name for c in f.sizes}
    mine, none = model.pack(zero, GAIT), plain.pack({}, GAIT)
    bare = len(plain.full.parameter_names)
    np.testing.assert_array_equal(mine.p[:bare], none.p[:bare])
    np.testing.assert_array_equal(mine.camera[: none.camera.size], none.camera)
    assert (mine.delay_s, mine.clock_s) == (none.delay_s, none.clock_s)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_of_the_packing_are_those_of_differences(name):
    model = Model(wpi_srs())
    rng = np.random.default_rng(0)
    mine = [c for f in forms_of(all_effects()[name], 5) for c in f.coordinates]
    values = {c.name: c.start + 0.2 * c.typical * rng.uniform(0.5, 1) for c in mine}
    seeds = model.seeds(values, GAIT, mine)

    def flat(packed, k=None):
        parts = (packed.p, packed.camera, packed.delay_s, packed.clock_s)
        return np.concatenate([v if k is None else v[:, k] for v in parts])

    for k, c in enumerate(mine):
        h = 1e-5 * c.typical
        ends = [flat(model.pack({**values, c.name: values[c.name] + s * h}, GAIT)) for s in (1, -1)]
        assert flat(seeds, k) == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-5, abs=1e-7)
        assert np.any(flat(seeds, k) != 0)


@pytest.mark.parametrize("name", NAMES)
def test_a_trial_without_tether_is_free_of_the_tether(name):
    model, effect = Model(wpi_srs()), all_effects()[name]
    mine = [c for f in forms_of(effect, 5) for c in f.sizes]
    seeds = model.seeds({}, Conditions(50.0, 2.0, tether=False), mine)
    moved = any(np.any(v != 0) for v in (seeds.p, seeds.camera, seeds.delay_s, seeds.clock_s))
    assert moved is not effect.of_tether


@pytest.fixture(scope="module")
def track():
    robot = wpi_srs()
    time_s = np.arange(70) / 100
    blank = np.zeros((time_s.size, robot.links, 2))
    trial = Trial("t", 1.5, 48.0, 0.4, np.pi / 2, 0.7, 0.7, time_s, markers_m=blank)
    return Experiment(Model(robot), [trial], 0.001).work


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_of_the_picture_are_those_of_differences(track, name):
    fine = 2e-8
    start = start_point(fitted_coordinates(wpi_srs())).values
    form = forms_of(all_effects()[name], 5)[-1]
    jacobian = track.predict("t", Point(start), form.sizes, fine).jacobian
    for k, c in enumerate(form.sizes):
        h = 2e-3 * c.typical
        signs = (1, -1) if c.lower < 0 else (1, 0)
        ends = [track.predict("t", Point({**start, c.name: s * h}), (), fine).points for s in signs]
        difference = (ends[0] - ends[1]) / ((signs[0] - signs[1]) * h)
        assert np.linalg.norm(jacobian[:, :, k] - difference) < 0.06 * np.linalg.norm(difference)


@pytest.mark.parametrize("name", DISSIPATING)
def test_what_must_dissipate_does(name):
    """Forces of wheels and hose take power out of any motion, sizes as physics bounds them."""
    robot = wpi_srs().with_values(effects=[entry_of(name)])
    parameters, m, _ = build(Structure.of(robot))
    pose, u = ca.SX.sym("pose", 3), ca.SX.sym("u", 3)
    f = m.forces(pose, u[0], u[1], u[2])
    power = ca.Function("power", [m.kappa, m.dkappa, pose, u, parameters.vector], [f.power])
    p, rng = parameters.pack(robot, 50, 2), np.random.default_rng(0)
    for _ in range(20):
        motion = rng.normal(size=4) * 5, rng.normal(size=4) * 20, rng.normal(size=3), rng.normal(size=3)
        assert float(power(*motion, p)) < 0


@pytest.mark.parametrize("name", NAMES)
def test_round_trip_through_the_robot_file(name, tmp_path):
    effect = all_effects()[name]
    sizes = [effect.size, *(p for p in effect.parameters if isinstance(p, Component))]
    entry = {**entry_of(name), "sd": {p.name: 0.1 * p.typical for p in sizes}}
    robot = wpi_srs().with_values(effects=[entry])
    saved = load_robot(save_robot(robot, tmp_path / "robot.yaml"))
    assert dict(saved.effects[0]) == dict(robot.effects[0]) == entry
    assert saved.plugins == (("mud_plugin.py",) if name == OWN else ())
    form = form_of_entry(saved.effects[0])
    back = form.entry(form.values(entry))
    assert back == pytest.approx({k: v for k, v in entry.items() if k != "sd"}, abs=1e-12)
    assert {c.name for c in form.refitted(entry)} == {c.name for c in form.sizes}
    assert not form.refitted(entry_of(name))


@pytest.mark.parametrize("name", [n for n in NAMES if n == OWN or built_in()[n].instrument])
def test_its_instrument_sees_it(name):
    effect, model = all_effects()[name], Model(wpi_srs())
    if effect.instrument is None:
        pytest.skip("nothing measures it directly")
    read = check_expectations(model)[effect.instrument]
    size = Form(effect).sizes[0]
    assert abs(read({size.name: size.typical}) - read({})) > 0.3 * abs(
        size.typical * (9.81 if effect.kind == "body" else 1)
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_its_size_is_calibrated_within_its_interval(name, tmp_path):
    """The laboratory's truth, entered with a deviation and half its size, is found again."""
    hidden = "viscous_rolling" if name == OWN else name
    assert hidden in LISTED
    truth = small_set(tmp_path / "set", (hidden,), trials=6)
    true = {**truth.effects[0], "name": name}
    effect = all_effects()[name]
    entry = {**true, effect.size.name: 0.5 * true[effect.size.name]}
    sizes = [effect.size, *(p for p in effect.parameters if isinstance(p, Component))]
    entry["sd"] = {p.name: 2 * abs(p.typical) for p in sizes}
    dataset = load_dataset(tmp_path / "set")
    found = calibrate(replace(dataset, robot=dataset.robot.with_values(effects=[entry])))
    assert found.after < 1.05
    (after,) = found.robot.effects
    sd = after["sd"][effect.size.name]
    assert math.isfinite(sd)
    assert abs(after[effect.size.name] - true[effect.size.name]) < 4.5 * sd
