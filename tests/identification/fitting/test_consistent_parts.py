"""Steps of the search for consistent links by hand: least steps, their share, roots, flatness, nominal bodies."""

from typing import Any

import numpy as np
import pytest

from snarelab.errors import InputError
from snarelab.identification.fitting.base_parameters import _combination, _independent
from snarelab.identification.fitting.consistent_inertia import (
    _flatness,
    _least_step,
    _moved,
    _nominal,
    _root,
    _Search,
    _share,
)
from snarelab.models.inertia import from_central, from_pseudo_inertia, pseudo_inertia


@pytest.mark.parametrize("weight", [0.0, 0.3, 5.0])
def test_the_least_step_is_the_ridge_regressions(weight):
    """M' (M M' + w/2)⁻¹ r, which at no weight is the least that meets r."""
    rng = np.random.default_rng(0)
    measured, right = rng.normal(size=(3, 10)), rng.normal(size=3)
    wanted = measured.T @ np.linalg.solve(measured @ measured.T + 0.5 * weight * np.eye(3), right)
    np.testing.assert_allclose(_least_step(measured, right, weight), wanted, rtol=1e-9)


@pytest.mark.parametrize(
    ("stretch", "curvature", "share"),
    [
        ([0.0, 0.0], 0.0, 1.0),
        ([8.9], 0.0, 1.0),
        ([9.1], 0.0, 0.5),  # more than tenfold
        ([18.5], 0.0, 0.25),  # 10.25 at half of it
        ([-0.95], 9e9, 0.5),  # a twentieth would be left
        # At the whole step the slope is e² (1 / (1 + e) - 1) = 2.56 for e = -0.8: ½ (0.64 + curvature) at most.
        ([-0.8], 0.0, 0.5),
        ([-0.8], 4.4, 0.5),
        ([-0.8], 4.6, 1.0),
        ([0.5, -0.8], 4.4, 1.0),  # 0.25 / 1.5 - 0.25 less, and half of 0.25 more allowed
    ],
)
def test_a_step_is_halved_until_nothing_grows_tenfold_and_it_does_not_go_uphill(stretch, curvature, share):
    assert _share(np.array(stretch), curvature) == share


@pytest.mark.parametrize(
    ("information", "rank"),
    [
        (np.diag([4.0, 0.0, 9.0]), 2),
        (np.ones((2, 2)), 1),
        (np.diag([1e-20, 1e20]), 2),  # in units of their own they are alike
        ([[1.0, 1.0 - 1e-12], [1.0 - 1e-12, 1.0]], 2),
        ([[1.0, 1.0 - 1e-13], [1.0 - 1e-13, 1.0]], 1),
        ([[1.0, 1.0 + 1e-9], [1.0 + 1e-9, 1.0]], 1),  # rounding
        ([[5.0]], 1),
    ],
)
def test_the_root_of_information_has_its_rank(information, rank):
    information = np.array(information)
    root = _root(information)
    assert root.shape == (len(information), rank)
    spread = np.sqrt(np.outer(np.diag(information), np.diag(information)))
    np.testing.assert_allclose(root @ root.T, information, atol=1e-8 * np.where(spread > 0, spread, 1.0).max())


@pytest.mark.parametrize(
    "information",
    [
        [[1.0, 0.1], [0.0, 1.0]],
        [[1.0, 1.0 + 1e-8], [1.0 + 1e-8, 1.0]],
        [[-1.0, 0.0], [0.0, 1.0]],
    ],
)
def test_what_is_no_information_is_refused(information):
    with pytest.raises(InputError, match="not symmetric and positive"):
        _root(np.array(information))


def body(mass, second, com=(0.0, 0.0, 0.0)):
    """Second moments of mass along the axes about the centre."""
    second = np.array(second, float)
    return from_central(mass, com, np.diag(second.sum() - second))


@pytest.mark.parametrize(
    ("links", "least"),
    [
        ([body(2.0, [1.0, 2.0, 5.0])], 1 / 8),
        ([body(2.0, [1.0, 2.0, 5.0]), body(7.0, [0.1, 1.0, 0.9])], 1 / 20),
        ([body(1e-6, [3e-9, 3e-9, 3e-9])], 1 / 3),  # of its own size
        ([body(2.0, [1.0, 0.0, 1.0])], 0.0),
    ],
)
def test_flatness_is_the_thinnest_share_of_any_link(links, least):
    assert _flatness(np.concatenate(links)) == pytest.approx(least, abs=1e-12)


def second_of(phi):
    """Mass, centre, and second moments (3, 3) about it."""
    matrix, mass = pseudo_inertia(phi), phi[0]
    centre = matrix[:3, 3] / mass
    return mass, centre, matrix[:3, :3] - mass * np.outer(centre, centre)


def test_nominal_links_get_the_mass_and_thickness_that_they_lack():
    """Masses 3 and 1; second moments about their frames 1 + 2 + 3 + 3·0.2² and 1·1: of all links (7.12 / 4) m²."""
    whole, point = body(3.0, [1.0, 2.0, 3.0], (0.2, 0.0, 0.0)), body(1.0, [0, 0, 0], (0.0, 1.0, 0.0))
    size = np.sqrt(7.12 / 4)
    first, second, third = _nominal(np.concatenate([whole, point, np.zeros(10)])).reshape(3, 10)
    np.testing.assert_allclose(first, whole, atol=1e-12)
    mass, centre, moments = second_of(second)
    assert mass == 1.0
    np.testing.assert_allclose(centre, [0, 1, 0])
    np.testing.assert_allclose(moments, (0.01 * size) ** 2 * np.eye(3), atol=1e-12)
    mass, centre, moments = second_of(third)
    assert mass == pytest.approx(4e-3)
    np.testing.assert_allclose(centre, 0.0)
    np.testing.assert_allclose(moments, 4e-3 * (0.1 * size) ** 2 * np.eye(3), atol=1e-12)


def test_where_no_link_has_mass_each_weighs_a_kilogram():
    mass, _, moments = second_of(_nominal(np.zeros(10)))
    assert mass == 1.0
    np.testing.assert_allclose(moments, 0.01 * np.eye(3), atol=1e-12)


def test_a_step_changes_a_pseudo_inertia_by_its_factor_on_either_side():
    """dP = C S C' with S = (E_ab + E_ba) / √2, or E_aa; what the data see of it is their matrix times it."""
    phi = np.concatenate([body(2.0, [1.0, 2.0, 3.0], (0.1, 0.2, 0.3)), body(5.0, [2.0, 1.0, 1.5])])
    matrix = np.random.default_rng(3).normal(size=(4, 20))
    search = _Search(matrix, np.zeros(4), phi)
    factor, by_phi, seen = search._coordinates(phi)
    for link in range(2):
        whole = pseudo_inertia(phi[10 * link : 10 * link + 10])
        np.testing.assert_allclose(factor[link] @ factor[link].T, whole, atol=1e-12)
        for k, (a, b) in enumerate(zip(*np.triu_indices(4), strict=True)):
            unit = np.zeros((4, 4))
            unit[a, b] = unit[b, a] = 1.0 if a == b else np.sqrt(0.5)
            change = from_pseudo_inertia(factor[link] @ unit @ factor[link].T)
            np.testing.assert_allclose(by_phi[link, k], change, atol=1e-12)
            step = np.zeros(20)
            step[10 * link + k] = 2.0
            moved = np.zeros(20)
            moved[10 * link : 10 * link + 10] = 2.0 * change
            np.testing.assert_allclose(_moved(by_phi, step), moved, atol=1e-12)
            np.testing.assert_allclose(seen @ step, matrix @ moved, atol=1e-10)


def test_columns_are_kept_if_a_hundred_thousandth_of_the_largest_is_their_own():
    one, two, three = 10.0 * np.eye(4)[:3]
    columns = [one, 2 * one, 0 * one, one + 1.9e-5 * two, two, one + two + 2.1e-5 * three]
    found = _independent(np.stack(columns, 1))  # the largest is 20 long: 2e-4, and 1.9e-4 and 2.1e-4 of their own
    assert found.tolist() == [0, 4, 5]


@pytest.mark.parametrize(
    ("own", "row", "text"),
    [
        (1, [0.0, 1.0, 0.0, 0.0], "mx[a]"),
        (1, [0.25, 1.0, -0.5, 0.0], "mx[a] + 0.25*mass[a] - 0.5*mass[b]"),
        (0, [1.0, -1.0, 0.99999, 2.0], "mass[a] - mx[a] + mass[b] + 2*mx[b]"),
        (3, [1234.56, 0.0, 0.0, 1.0], "mx[b] + 1235*mass[a]"),
    ],
)
def test_a_combination_in_words_has_its_own_parameter_first(own, row, text):
    standard: Any = [("a", "mass"), ("a", "mx"), ("b", "mass"), ("b", "mx")]
    assert _combination(own, np.array(row), standard) == text
