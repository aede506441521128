"""Markers anywhere on the robot: geometry by walking along it, shapes, data sets, calibration's picture."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from measure_fixtures import HEADER, ROBOT, ROBOT_YAML, track_text

from srs_opt.calibrate.observe import _body_points
from srs_opt.document import Document
from srs_opt.errors import InputError
from srs_opt.measurement.chain import chain_of, headings, link_positions, marker_jacobian, marker_positions
from srs_opt.measurement.dataset import load_dataset, write_dataset
from srs_opt.measurement.find_chain import find_chain, symmetric
from srs_opt.measurement.labels import correct_labels
from srs_opt.measurement.shape import shape_from_markers
from srs_opt.measurement.spots import Spot, load_spots, named_layout, spots_of
from srs_opt.measurement.validate import problems
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build

ENDS = named_layout("chamber_ends", 5)
ODD = (
    Spot(link=1, dx_m=-0.01),
    Spot(segment=1, at=0.25, dy_m=0.012),
    Spot(link=3, dx_m=0.004, dy_m=-0.01),
    Spot(segment=4, at=0.3),
    Spot(link=5, dx_m=0.02),
)
THREE = (Spot(link=1), Spot(link=3), Spot(link=5))


def some(count, seed=0):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.normal(size=(count, 3)), 8 * rng.normal(size=(count, 4))])


def walked(spot, q, steps=4000):
    """Where a marker is: from its link straight on, along the chamber in tiny straight steps, to the left."""
    chain = chain_of(ROBOT)
    k = (spot.link or spot.segment) - 1
    x, y = link_positions(chain, q)[k]
    angle = headings(chain, q)[k]
    first = spot.dx_m if spot.link else 0.006
    x, y = x + first * math.cos(angle), y + first * math.sin(angle)
    if spot.segment:
        step = spot.at * 0.037 / steps
        for _ in range(steps):
            angle += q[3 + k] * step / 2
            x, y = x + step * math.cos(angle), y + step * math.sin(angle)
            angle += q[3 + k] * step / 2
    return x - spot.dy_m * math.sin(angle), y + spot.dy_m * math.cos(angle)


@pytest.mark.parametrize("spots", [ENDS, ODD], ids=["ends", "odd"])
def test_places_and_derivatives(spots):
    chain = chain_of(ROBOT, spots)
    q = some(3)
    found = marker_positions(chain, q)
    for k in range(2):
        assert np.allclose(found[k], [walked(spot, q[k]) for spot in spots], atol=1e-8)
    jacobian = marker_jacobian(chain, q)
    for j in range(7):
        step = 1e-6 * np.eye(7)[j]
        numeric = (marker_positions(chain, q + step) - marker_positions(chain, q - step)) / 2e-6
        assert np.allclose(jacobian[..., j], numeric, atol=1e-7)


@pytest.mark.parametrize("ratio", [False, True])
def test_calibration_sees_the_same_places(ratio):
    from srs_opt.effects import all_effects

    effects = tuple(n for n, e in all_effects().items() if e.gap_ratio) if ratio else ()
    parameters, m, _ = build(Structure("complex", 5, "per_axis", effects))
    points = _body_points(m, (*ODD, Spot(segment=2, at=0.0), Spot(segment=2, at=1.0)))
    function = ca.Function("p", [m.kappa, parameters.vector], [ca.horzcat(points.x, points.y), m.chain.x])
    values = [getattr(ROBOT, n, 0.5) for n in parameters.names]
    q = np.concatenate([np.zeros(3), some(1, 3)[0, 3:]])
    got, links = (np.asarray(v) for v in function(q[3:], values))
    if not ratio:
        assert np.allclose(got[:5], marker_positions(chain_of(ROBOT, ODD), q), atol=1e-12)
    else:  # a chamber's ends lie half a gap, straight or bent, from the links at either end
        assert np.isclose(np.hypot(*(got[5] - got[6])), 0.037, rtol=0.05)
        assert links[1] < got[5, 0] < got[6, 0] < links[2]


@pytest.mark.parametrize("spots", [ENDS, ODD, named_layout("chamber_middles", 5)])
def test_shape_from_any_places(spots):
    rng = np.random.default_rng(1)
    q = some(40)
    q[:, 3:] = 6 * rng.normal(size=(40, 4))
    points = marker_positions(chain_of(ROBOT, spots), q)
    found = shape_from_markers(ROBOT, points, 1e-6, spots=spots)
    if spots is ENDS:
        assert found.determined.all()
    gap = marker_positions(chain_of(ROBOT, spots), found.configuration) - points
    assert np.abs(gap).max() < 1e-4  # what the prior takes where markers do not determine all
    if spots is ENDS:
        assert np.abs(found.curvature_1_m - q[:, 3:]).max() < 0.02
    points[5, 2] = np.nan
    assert np.isfinite(shape_from_markers(ROBOT, points, 1e-3, spots=spots).configuration).all()


def test_three_markers_give_a_finite_shape():
    points = marker_positions(chain_of(ROBOT, THREE), some(10))
    found = shape_from_markers(ROBOT, points, 1e-3, spots=THREE)
    assert np.isfinite(found.configuration).all()
    assert not found.determined.any()


def test_unordered_positions_are_found_and_uneven_spacing_tells_the_tail():
    rng = np.random.default_rng(0)
    for spots in (ENDS, ODD, THREE):
        chain = chain_of(ROBOT, spots)
        q = np.concatenate([[0.3, 0.2, 0.7], 5 * rng.normal(size=4)])
        order = rng.permutation(len(spots))
        found = find_chain(chain, marker_positions(chain, q)[order])
        named = order[found].tolist()
        assert named in (list(range(len(spots))), list(range(len(spots)))[::-1])
        if not symmetric(chain):
            assert named == list(range(len(spots)))
    assert symmetric(chain_of(ROBOT, ENDS)) and not symmetric(chain_of(ROBOT, ODD))


def test_swapped_labels_of_chamber_ends_are_mended():
    chain = chain_of(ROBOT, ENDS)
    q = np.tile([0, 0, 0.2, 4, -3, 2, 1.0], (30, 1))
    q[:, 0] = np.linspace(0, 0.05, 30)
    points = marker_positions(chain, q)
    bad = points.copy()
    bad[10:15, [1, 5]] = bad[10:15, [5, 1]]
    mended = correct_labels(chain, bad)
    assert np.allclose(mended.markers_m, points)
    assert mended.swapped.sum() == 5


def written(folder, markers, spots, frames=60):
    (folder / "trials").mkdir(parents=True)
    (folder / "robot.yaml").write_text(ROBOT_YAML)
    camera = "camera: {rate_hz: 120, marker_sd_m: 0.001}\n"
    (folder / "dataset.yaml").write_text(f"name: s\nrobot: robot.yaml\n{camera}markers: {markers}\n")
    (folder / "trials.csv").write_text(HEADER + f"a,2,50,0,1.57,0,{frames / 120}\n")
    q = np.zeros((frames, 7))
    q[:, 0] = 0.098 + 0.0005 * np.arange(frames)
    points = marker_positions(chain_of(ROBOT, spots), q)
    points += 1e-3 * np.random.default_rng(0).normal(size=points.shape)
    (folder / "trials" / "a.csv").write_text(track_text(np.arange(frames) / 120, points))
    return folder


def test_data_set_with_places_is_read_and_written_again(tmp_path):
    markers = "[{link: 1, dx_m: -0.01}, {segment: 1, at: 0.25, dy_m: 0.012}, {link: 5}]"
    spots = (Spot(link=1, dx_m=-0.01), Spot(segment=1, at=0.25, dy_m=0.012), Spot(link=5))
    data = load_dataset(written(tmp_path / "s", markers, spots))
    assert data.trials[0].spots == spots
    assert data.trials[0].markers_m.shape == (60, 3, 2)
    assert [p for p in problems(tmp_path / "s") if "start" in p.message] == []
    write_dataset(data, tmp_path / "again")
    assert load_dataset(tmp_path / "again").trials[0].spots == spots


@pytest.mark.parametrize(
    ("markers", "said"),
    [
        ("[{link: 6}, {link: 1}]", "link 6: the robot has 5 links"),
        ("[{segment: 5, at: 0}, {link: 1}]", "segment 5: the robot has 4 segments"),
        ("[{segment: 1}, {link: 1}]", "at is missing"),
        ("[{segment: 1, at: 0.5, dx_m: 0.1}, {link: 1}]", "dx_m does not go with segment"),
        ("[{link: 1, at: 0.5}, {link: 2}]", "at does not go with link"),
        ("[{dx_m: 0.1}, {link: 2}]", "either link"),
        ("[{link: 1}, {link: 1}]", "is the place of marker 1 too"),
        ("[{link: 1}]", "at least 2 entries"),
        ("[{link: 1, at_m: 2}, {link: 2}]", "at_m"),
        ("[{segment: 1, at: 1.5}, {link: 2}]", "1.5"),
        ("[1, 2]", "expected a mapping"),
        ("{link: 1}", "list of places"),
        ("[{link: 1}, {link: 2}, {link: 5}, {link: 4}]", "has 3 markers where dataset.yaml lists 4"),
    ],
)
def test_faulty_places_are_told_with_the_line(tmp_path, markers, said):
    folder = written(tmp_path / "s", markers, THREE)
    with pytest.raises(InputError, match=said):
        load_dataset(folder)
    assert all(p.line for p in problems(folder) if p.file == "dataset.yaml")


def test_layouts_by_name_or_file(tmp_path):
    assert load_spots("chamber_ends", 5) == ENDS
    file = tmp_path / "m.yaml"
    file.write_text("markers: [{link: 1}, {segment: 2, at: 0.5}]\n")
    assert load_spots(str(file), 5) == (Spot(link=1), Spot(segment=2, at=0.5))
    with pytest.raises(InputError, match="chamber_middles or a file"):
        load_spots("ends", 5)


entry = st.dictionaries(
    st.sampled_from(["link", "segment", "at", "dx_m", "dy_m", "x"]),
    st.one_of(st.integers(-3, 9), st.floats(), st.text(max_size=4), st.none(), st.booleans()),
    max_size=4,
)


@given(st.one_of(st.lists(entry, max_size=8), entry, st.integers(), st.none()))
@settings(max_examples=150, deadline=None)
def test_any_list_is_read_or_refused_in_one_line(value):
    spots, wrong = spots_of(Document("f.yaml", {"markers": value}), ("markers",), 5)
    assert bool(spots) != bool(wrong)
    assert all("\n" not in str(w) for w in wrong)
    if spots:
        assert np.isfinite(chain_of(ROBOT, spots).straight_m).all()
