"""Robot files: what is taken, and every refusal in one line with file and line."""

import copy
import dataclasses
import json
import pickle

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from srs_opt.errors import InputError
from srs_opt.gait import published_wave
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import Robot, load_robot, save_robot, wpi_srs


def write(tmp_path, text):
    path = tmp_path / "robot.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def refusal(path):
    with pytest.raises(InputError) as caught:
        load_robot(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(path))
    return message[len(str(path)) :]


def test_built_in_robot_is_table_2():
    robot = load_robot()
    assert (robot.links, robot.segments) == (5, 4)
    assert robot.segment_length_m == 0.037
    assert robot.link_mass_kg == 0.030
    assert (robot.friction_tangential, robot.friction_normal) == (0.043, 0.57)
    assert robot.pitch_m == pytest.approx(0.049)
    assert robot.length_m == pytest.approx(4 * 0.049 + 0.040)


def test_built_in_robot_says_what_is_published_and_what_assumed():
    sources = wpi_srs().sources
    physical = {f.name for f in dataclasses.fields(Robot)} - {
        "name",
        "effects",
        "plugins",
        "relative_sd",
        "sources",
    }
    assert set(sources) == physical
    published = {"segment_length_m", "link_mass_kg", "friction_tangential", "friction_normal", "links"}
    assert {k for k, v in sources.items() if v == "published"} == published | {"gravity_m_s2"}
    for key in ("gap_length_m", "curvature_per_pressure_1_m_kpa", "tau1_s", "tau2_s", "body_width_m"):
        assert sources[key] == "assumed"


def test_keys_left_out_take_the_built_in_values(tmp_path):
    robot = load_robot(write(tmp_path, "name: bare\n"))
    plain = wpi_srs()
    for field in dataclasses.fields(Robot):
        if field.name not in ("name", "sources"):
            assert getattr(robot, field.name) == getattr(plain, field.name)


@pytest.mark.parametrize("number", ["1e-06", "1E-6", "1.0e-06", "0.000001", ".000001", "+1e-6"])
def test_numbers_as_people_write_them(tmp_path, number):
    assert load_robot(write(tmp_path, f"link_inertia_kg_m2: {number}\n")).link_inertia_kg_m2 == 1e-6


@pytest.mark.parametrize("links", [3, 4, 5, 17, 64])
def test_any_number_of_links_from_3_to_64(tmp_path, links):
    robot = load_robot(write(tmp_path, f"links: {links}\n"))
    assert robot.segments == links - 1


def test_whole_numbers_are_whole_and_others_are_floats(tmp_path):
    robot = load_robot(write(tmp_path, "links: 7.0\ngravity_m_s2: 9\n"))
    assert isinstance(robot.links, int)
    assert isinstance(robot.gravity_m_s2, float)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("links: 2\n", ":1: links: must be at least 3, found 2"),
        ("\nlinks: 65\n", ":2: links: must be at most 64, found 65"),
        ("links: 5.5\n", ":1: links: expected a whole number"),
        ("links: five\n", ":1: links: expected a whole number, found 'five'"),
        ("links: true\n", ":1: links: expected a whole number"),
        ("name: a\n\nsegment_lenght_m: 0.03\n", ":3: segment_lenght_m: unknown key"),
        ("# no\ntau1_s: 0\n", ":2: tau1_s: must be greater than 0, found 0"),
        ("tau1_s: -0.1\n", ":1: tau1_s: must be greater than 0"),
        ("tau1_s: .nan\n", ":1: tau1_s: must be a finite number"),
        ("tau1_s: 1e999\n", ":1: tau1_s: must be a finite number"),
        ("tau1_s: '0.1'\n", ":1: tau1_s: expected a number, found '0.1'"),
        ("tau1_s: 1_0\n", ":1: tau1_s: expected a number"),
        ("tau1_s: [0.1]\n", ":1: tau1_s: expected a number"),
        ("tau1_s:\n", ":1: tau1_s: expected a number, found None"),
        ("link_mass_kg: 1000\n", ":1: link_mass_kg: must be at most 100"),
        ("friction_law: coulomb\n", ":1: friction_law: must be one of per_axis, cone"),
        ("friction_normal: 0\n", ":1: friction_normal: must be greater than 0"),
        ("relative_sd:\n  tau9: 0.1\n", ":2: relative_sd.tau9: is not a parameter"),
        ("relative_sd: {tau1_s: -0.1}\n", ":1: relative_sd.tau1_s: must be at least 0"),
        ("sources:\n  tau1_s: guess\n", ":2: sources.tau1_s: must be one of published"),
        ("effects: tether_drag\n", ":1: effects: expected a list"),
        ("effects:\n  - tether_drag\n", ":2: effects[0]: expected a mapping of keys"),
        ("effects:\n  - {force_n: 1}\n", ":2: effects[0]: key 'name' is missing"),
        ("effects:\n  - name: tether_drag\n    force_n: -1\n", ":3: effects[0].force_n: must be at least 0"),
        ("name: a\nname: b\n", ":2: key 'name' is given twice"),
        ("- links\n", "expected a mapping of keys"),
        ("", "expected a mapping of keys"),
        ("links: [1, 2\n", "not valid YAML"),
        ("name: !!python/object:os.system {}\n", ":1:"),
        ("name: \x07\n", "not valid YAML"),
    ],
)
def test_refusals_name_file_line_key_and_what_was_expected(tmp_path, text, expected):
    assert expected in refusal(write(tmp_path, text))


def test_unknown_keys_come_with_a_suggestion(tmp_path):
    assert "did you mean 'gap_length_m'?" in refusal(write(tmp_path, "gap_lenght_m: 0.01\n"))
    assert "known: " in refusal(write(tmp_path, "colour: red\n"))


def test_files_that_are_none(tmp_path):
    assert "no such file" in refusal(tmp_path / "missing.yaml")
    assert "is a folder" in refusal(tmp_path)
    binary = tmp_path / "robot.bin"
    binary.write_bytes(bytes(range(256)))
    assert "not UTF-8" in refusal(binary)


def test_deep_and_exploding_documents_end_quickly(tmp_path):
    refusal(write(tmp_path, "a: " + "[" * 5000))
    bomb = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 60))
    refusal(write(tmp_path, bomb))


EFFECTS = [{"name": "segment_bias", "bias": 2.0, "segment": 3}, {"name": "hysteresis", "ratio": 0.3}]


def test_saved_robots_read_back(tmp_path):
    robot = wpi_srs().with_values(
        effects=EFFECTS, relative_sd={"tau1_s": 0.1}, link_inertia_kg_m2=1e-7, name="Zürich: 2"
    )
    path = save_robot(robot, tmp_path / "new folder" / "robot.yaml")
    again = load_robot(path)
    assert again == robot
    assert again.fingerprint() == robot.fingerprint()
    assert hash(again) == hash(robot)
    assert json.dumps(robot.to_record())


def test_robots_travel_to_worker_processes():
    robot = wpi_srs().with_values(effects=EFFECTS)
    for other in (pickle.loads(pickle.dumps(robot)), copy.deepcopy(robot)):
        assert other == robot
        assert hash(other) == hash(robot)


def test_robots_are_values():
    robot = wpi_srs()
    with pytest.raises(dataclasses.FrozenInstanceError):
        robot.links = 6
    with pytest.raises(TypeError):
        robot.with_values(effects=EFFECTS).effects[0]["bias"] = 1.0
    assert robot.with_values(tau1_s=0.1) != robot
    assert robot.with_values(name="other").fingerprint() == robot.fingerprint()
    assert robot.with_values(tau1_s=0.1).fingerprint() != robot.fingerprint()


def test_changed_copies_are_validated_too():
    with pytest.raises(InputError, match=r"robot 'WPI SRS': links: must be at least 3"):
        wpi_srs().with_values(links=1)
    with pytest.raises(InputError, match="unknown key 'link'"):
        wpi_srs().with_values(link=5)


KEYS = [f.name for f in dataclasses.fields(Robot)]
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["1e-6", "0x1"])
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["name", "segment", "bias", "force_n", *KEYS]) | st.text(max_size=5),
            inner,
            max_size=3,
        )
    ),
    max_leaves=8,
)


@settings(max_examples=300, deadline=None)
@given(st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=5), VALUES, max_size=5))
def test_any_mapping_is_a_robot_or_one_line(tmp_path_factory, record):
    path = tmp_path_factory.mktemp("fuzz") / "robot.yaml"
    path.write_text(yaml.safe_dump(record, allow_unicode=True), encoding="utf-8")
    robot_or_one_line(path)


@settings(max_examples=300, deadline=None)
@given(
    st.binary(max_size=200)
    | st.text(alphabet="{}[]&*!|>%@-:#,'\" \n\tab019.e~<?", max_size=60).map(str.encode)
)
def test_any_bytes_are_a_robot_or_one_line(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("fuzz") / "robot.yaml"
    path.write_bytes(content)
    robot_or_one_line(path)


ENTRY = st.fixed_dictionaries(
    {"name": st.sampled_from(["tether_drag", "segment_bias", "hysteresis", "camera_tilt", "nonsense"])},
    optional=dict.fromkeys(("force_n", "bias", "segment", "ratio", "width", "per_m"), SCALARS),
)


@settings(max_examples=200, deadline=None)
@given(st.lists(ENTRY, max_size=3))
def test_any_effects_are_a_robot_or_one_line(tmp_path_factory, entries):
    path = tmp_path_factory.mktemp("fuzz") / "robot.yaml"
    path.write_text(yaml.safe_dump({"effects": entries}), encoding="utf-8")
    robot_or_one_line(path)


def robot_or_one_line(path):
    try:
        robot = load_robot(path)
    except InputError as error:
        assert str(error).startswith(str(path))  # noqa: PT017
        assert "\n" not in str(error)  # noqa: PT017
        return
    assert 3 <= robot.links <= 64
    assert hash(robot) == hash(pickle.loads(pickle.dumps(robot)))


def test_a_body_without_wheels_may_slide_more_easily_across(tmp_path):
    """Any ratio of friction is a body: one that slides across more easily goes along its wave."""
    path = tmp_path / "scales.yaml"
    path.write_text("friction_tangential: 0.3\nfriction_normal: 0.2\n")
    robot = load_robot(path)
    gait = published_wave(robot, frequency_hz=2.0, pressure_kpa=48.0).gait()
    assert steady_gait(robot, gait).speed_m_s < -0.005
    assert steady_gait(wpi_srs(), gait).speed_m_s > 0.05
    again = load_robot(save_robot(robot, tmp_path / "again.yaml"))
    assert (again.friction_tangential, again.friction_normal) == (0.3, 0.2)
