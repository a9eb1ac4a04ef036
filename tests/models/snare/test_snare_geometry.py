"""The cables' start: the paper's helices, the elastica that they spring to, and dimensions that cannot be built."""

# pyright: reportArgumentType=false

from math import asin, pi, sqrt

import numpy as np
import pytest
from scipy.special import ellipe, ellipk

from snarelab.errors import InputError
from snarelab.models.snare.drive import frame_at, ring_ends, ring_motion
from snarelab.models.snare.geometry import arc, helices, ring_points
from snarelab.models.snare.parameters import WIDE_RING, SnareParameters, wall_length
from snarelab.models.snare.settled import settled


def test_a_cable_against_the_wall_is_an_arc_of_120_degrees_about_the_ring_itself():
    p = SnareParameters(cable_length=wall_length(SnareParameters().ring_radius, 0.1))
    shape = arc(p)
    assert shape.angle == pytest.approx(2 * pi / 3, abs=1e-9)
    assert shape.radius == pytest.approx(p.ring_radius, rel=1e-9)
    nodes = helices(p, 10)
    assert np.hypot(nodes[..., 0, 1], nodes[..., 0, 2]) == pytest.approx(p.ring_radius, rel=1e-9)


def test_a_shorter_cable_lies_inside_the_ring_and_keeps_its_length():
    p = SnareParameters(cable_length=0.265)
    nodes = helices(p, 200)
    assert np.linalg.norm(np.diff(nodes[:, :, 0], axis=1), axis=-1).sum(axis=1) == pytest.approx(0.265, rel=1e-5)
    assert np.linalg.norm(nodes[:, :, 1], axis=-1) == pytest.approx(1.0, abs=1e-12)
    assert np.max(np.hypot(nodes[..., 0, 1], nodes[..., 0, 2])) <= p.ring_radius + 1e-12
    # the slope is the derivative by arc length: central differences, error of second order in 1.3 mm
    step = 0.265 / 200
    slope = (nodes[:, 2:, 0] - nodes[:, :-2, 0]) / (2 * step)
    assert np.max(np.abs(slope - nodes[:, 1:-1, 1])) < 1e-4


@pytest.mark.parametrize("parameters", [SnareParameters(), WIDE_RING, SnareParameters(ring_direction=1.0)])
def test_three_equal_cables_end_on_the_rings(parameters):
    nodes, ends = settled(parameters, 10), ring_points(parameters)
    assert np.array_equal(nodes[:, [0, -1], 0], ends)
    third = np.array([[1, 0, 0], [0, -0.5, sqrt(0.75)], [0, -sqrt(0.75), -0.5]])  # a turn by −120° about x
    assert np.max(np.abs(nodes[0] @ third.T - nodes[1])) < 1e-12


def test_at_rest_a_cable_is_the_elastica():
    p = SnareParameters()
    chord = np.linalg.norm(np.subtract(*ring_points(p)[0]))
    # closed form, inextensible (strain is 1e-4): chord/L = 2E/K − 1, height = 2k/(λ) with λ = 2K/L
    low, high = 1e-6, 0.99
    for _ in range(200):
        k = (low + high) / 2
        low, high = (k, high) if 2 * ellipe(k**2) / ellipk(k**2) - 1 > chord / p.cable_length else (low, k)
    height = k * p.cable_length / ellipk(k**2)
    nodes = settled(p, 10)[0]
    middle = np.linalg.norm(nodes[5, 0] - nodes[[0, -1], 0].mean(axis=0))
    assert middle == pytest.approx(height, rel=5e-4)  # axial strain P/EA changes the spare length by 1e-3
    cosine = nodes[0, 1] @ (nodes[-1, 0] - nodes[0, 0]) / chord / np.linalg.norm(nodes[0, 1])
    assert np.arccos(cosine) == pytest.approx(2 * asin(k), rel=1e-3)


def test_finer_elements_rest_in_the_same_place():
    coarse, fine = settled(SnareParameters(), 10), settled(SnareParameters(), 40)
    assert np.max(np.abs(coarse[:, :, 0] - fine[:, ::4, 0])) < 2e-6  # 10 elements: below 1 µm of bow, measured


def test_ring_starts_and_stops_smoothly_and_reaches_its_travel():
    p = SnareParameters()
    times = np.linspace(-0.5, 12.0, 200001)
    motion = np.array([ring_motion(t, p.ring_rate, p.ring_travel, p.ring_ramp) for t in times])
    assert motion[-1] == pytest.approx([p.ring_travel, 0.0], abs=1e-12)
    assert motion[:, 1].max() == pytest.approx(p.ring_rate)
    assert np.max(np.abs(np.gradient(motion[:, 0], times) - motion[:, 1])) < 1e-6
    jerk = np.diff(motion[:, 1], 2) / np.diff(times)[0] ** 2
    assert np.max(np.abs(jerk)) < 7 * p.ring_rate / p.ring_ramp**2  # 6 analytically: no jump of the rate's slope


def test_cable_ends_move_at_their_speeds():
    p = SnareParameters()
    frame = np.zeros((6, 3))
    path = np.zeros(32)
    path[1], path[5:8], path[8:11], path[11:14] = 1.0, [0.1, 0.2, -0.1], [0.1, 0.2, -0.1], [0.1, 0.2, -0.1]
    path[14:23] = np.eye(3).ravel()
    path[23:26] = path[26:29] = path[29:32] = [0.3, -0.4, 0.5]
    points, speeds = np.zeros((2, 6, 3)), np.zeros((6, 3))

    def place(time, into):
        frame_at(path, time, frame)
        angle, rate = ring_motion(time, p.ring_rate, p.ring_travel, p.ring_ramp)
        ring_ends(frame, p.ring_radius, p.ring_distance, p.ring_direction, angle, rate, into, speeds)

    place(0.4 - 1e-5, points[0])
    place(0.4 + 1e-5, points[1])
    place(0.4, np.zeros((6, 3)))
    assert np.max(np.abs((points[1] - points[0]) / 2e-5 - speeds)) < 1e-9


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"cable_length": 0.2}, "shorter than its chord"),
        ({"ring_radius": 0.09, "cable_length": 0.28}, "too small for a cable of 0.28 m"),
        ({"friction": -0.1}, "friction is -0.1 1; give >= 0"),
        ({"young_modulus": float("nan")}, "young_modulus is nan Pa; give > 0"),
        ({"ring_direction": 0.5}, "give 1 or -1"),
        ({"knob_length": 0.3}, "shorter than pin_length"),
    ],
)
def test_dimensions_that_cannot_be_built_are_refused(values, message):
    with pytest.raises(InputError, match=message):
        settled(SnareParameters().with_values(**values), 10)


def test_unknown_parameter_names_those_that_exist():
    with pytest.raises(InputError, match="no parameter 'ring_diameter'; known: ring_radius"):
        SnareParameters().with_values(ring_diameter=0.2)


def test_every_dimension_says_where_it_is_from():
    for dimension in SnareParameters(friction=0.2).dimensions():
        assert dimension.unit
        assert dimension.source
        assert (dimension.kind == "given") == (dimension.name == "friction")
