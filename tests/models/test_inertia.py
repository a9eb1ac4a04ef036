"""Inertial parameters against closed forms and brute force."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from snarelab.models import inertia


def point_cloud(seed: int, count: int = 40):
    """Random point masses: every quantity of a body, by summing over its points."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.1, 2.0, count), rng.normal(size=(count, 3)) * [0.5, 1.0, 2.0] + rng.normal(size=3)


def summed_inertia(masses, points):
    return np.sum([m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True)], axis=0)


def test_parameters_of_a_point_cloud_are_its_sums():
    masses, points = point_cloud(1)
    com = masses @ points / masses.sum()
    phi = inertia.from_central(masses.sum(), com, summed_inertia(masses, points - com))
    about_origin = summed_inertia(masses, points)
    expected = [masses.sum(), *(masses @ points), *about_origin[np.triu_indices(3)]]
    np.testing.assert_allclose(phi, expected, rtol=1e-12)
    mass, back, about_com = inertia.to_central(phi)
    np.testing.assert_allclose(mass, masses.sum(), rtol=1e-12)
    np.testing.assert_allclose(back, com, rtol=1e-12)
    np.testing.assert_allclose(about_com, summed_inertia(masses, points - com), rtol=1e-10, atol=1e-10)


def test_pseudo_inertia_is_the_second_moment_of_the_points():
    masses, points = point_cloud(2)
    phi = inertia.from_central(0.0, np.zeros(3), np.zeros((3, 3)))
    for m, p in zip(masses, points, strict=True):
        phi = phi + inertia.from_central(m, p, np.zeros((3, 3)))
    lifted = np.column_stack([points, np.ones(len(points))])
    np.testing.assert_allclose(inertia.pseudo_inertia(phi), lifted.T * masses @ lifted, rtol=1e-12)
    np.testing.assert_allclose(inertia.from_pseudo_inertia(lifted.T * masses @ lifted), phi, rtol=1e-12)


def test_transform_moves_the_points():
    masses, points = point_cloud(3)
    rotation, shift = Rotation.from_rotvec([0.3, -1.2, 0.7]).as_matrix(), np.array([0.4, -2.0, 1.0])
    phi = sum(inertia.from_central(m, p, np.zeros((3, 3))) for m, p in zip(masses, points, strict=True))
    moved = points @ rotation.T + shift
    expected = sum(inertia.from_central(m, p, np.zeros((3, 3))) for m, p in zip(masses, moved, strict=True))
    np.testing.assert_allclose(inertia.transform(phi, rotation, shift), expected, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize(
    ("mass", "moments", "physical"),
    [
        (1.0, (1.0, 1.0, 1.0), True),
        (1.0, (1.0, 1.0, 2.0), True),  # a plate: the limit
        (1.0, (0.0, 1.0, 1.0), True),  # a rod
        (1.0, (0.0, 0.0, 0.0), True),  # a point
        (1.0, (1.0, 1.0, 2.001), False),
        (1.0, (-0.001, 1.0, 1.0), False),
        (-1.0, (1.0, 1.0, 1.0), False),
        (0.0, (1.0, 1.0, 1.0), False),
        (0.0, (0.0, 0.0, 0.0), True),
    ],
)
def test_physical(mass, moments, physical):
    axes = Rotation.from_rotvec([0.2, 0.5, -0.4]).as_matrix()
    phi = inertia.from_central(mass, [0.3, -0.1, 2.0], axes @ np.diag(moments) @ axes.T)
    assert inertia.is_physical(phi) is physical


def test_physical_is_a_positive_pseudo_inertia():
    rng = np.random.default_rng(4)
    verdicts = set()
    for _ in range(200):
        axes = Rotation.from_quat(rng.normal(size=4)).as_matrix()
        phi = inertia.from_central(
            rng.uniform(0.1, 5.0), rng.normal(size=3), axes @ np.diag(rng.uniform(0, 3, 3)) @ axes.T
        )
        expected = np.linalg.eigvalsh(inertia.pseudo_inertia(phi))[0] > 0
        assert inertia.is_physical(phi) == expected
        verdicts.add(bool(expected))
    assert verdicts == {True, False}


def test_not_a_number_is_not_physical():
    assert not inertia.is_physical([1.0, np.nan, 0, 0, 1, 0, 0, 1, 0, 1])


def test_tolerance_is_relative():
    grain = inertia.from_central(1.0, np.zeros(3), 1e-9 * np.diag([1.0, 1.0, 2.001]))
    assert not inertia.is_physical(grain)
    assert inertia.is_physical(grain, tolerance=1e-3)


def test_nearest_keeps_what_is_physical():
    masses, points = point_cloud(5)
    com = masses @ points / masses.sum()
    about_com = summed_inertia(masses, points - com)
    phi = inertia.nearest_physical(masses.sum(), com, about_com)
    np.testing.assert_allclose(phi, inertia.from_central(masses.sum(), com, about_com), rtol=1e-12, atol=1e-12)


def test_nearest_closed_form_on_one_face():
    # Only moment 3 is too large: the projection on the plane I3 = I1 + I2 takes a third of the excess from each.
    phi = inertia.nearest_physical(2.0, np.zeros(3), np.diag([1.0, 1.2, 2.8]))
    np.testing.assert_allclose(phi[[4, 7, 9]], [1.2, 1.4, 2.6], rtol=1e-14)


@pytest.mark.parametrize("seed", range(8))
def test_nearest_beats_every_search(seed):
    """Brute force over all positive semi-definite second moments, not over principal axes only."""
    rng = np.random.default_rng(seed)
    axes = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    given = axes @ np.diag(rng.uniform(-1.0, 3.0, 3)) @ axes.T
    mass, com = 1.5, np.array([0.1, 0.2, -0.3])
    phi = inertia.nearest_physical(mass, com, given)
    assert inertia.is_physical(phi)
    kept_mass, kept_com, found = inertia.to_central(phi)
    np.testing.assert_allclose([kept_mass, *kept_com], [mass, *com], rtol=1e-14)

    def distance(entries):
        root = entries.reshape(3, 3)
        second = root @ root.T
        return np.sum((np.trace(second) * np.eye(3) - second - given) ** 2)

    best = min(minimize(distance, rng.normal(size=9), tol=1e-14).fun for _ in range(5))
    np.testing.assert_allclose(np.sum((found - given) ** 2), best, rtol=1e-6, atol=1e-9)
