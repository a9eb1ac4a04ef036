"""The rig study's unloading ratio, hang units and printed friction law, by hand."""

import numpy as np
import pytest

from snarelab.models.inertia import from_central
from snarelab.models.rig.rig import BAR, PLATE, ROD, built_in_rig
from snarelab.models.tree import Joint, Link, Tree
from snarelab.studies.zero_g_rig.flight import Flight
from snarelab.studies.zero_g_rig.unloading import (
    gravity_moments,
    printed_law,
    registered_law,
    unit_forces,
    unloading_ratio,
)


def test_the_registered_law_is_the_printed_one():
    speed = np.concatenate([np.linspace(-2, 2, 4001), np.linspace(-0.05, 0.05, 1001)])
    law = printed_law(speed)
    np.testing.assert_allclose(registered_law(speed), law["f"], atol=1e-12)
    np.testing.assert_allclose(law["f1"] + law["f2"] + law["f3"], law["f"], atol=1e-15)
    at = printed_law(np.array([0.01]))
    assert at["f"][0] == pytest.approx(0.5 * (np.tanh(1) - np.tanh(0.5)) + 0.1 * np.tanh(1) + 0.0005, rel=1e-14)


def two_links():
    """Two bars of 2 m and 3 m along x, 10 and 6 kg, about vertical joints."""
    z, eye = np.array([0.0, 0, 1]), np.eye(3)
    joints = (Joint("a", "revolute", z, -1, eye, np.zeros(3)), Joint("b", "revolute", z, 0, eye, np.array([2.0, 0, 0])))
    links = tuple(
        Link(name, from_central(mass, [length / 2, 0, 0], np.eye(3)))
        for name, mass, length in (("a", 10.0, 2.0), ("b", 6.0, 3.0))
    )
    return Tree("two", joints, links, np.array([0.0, 0, -9.81]))


def test_the_weights_moment_is_lever_times_weight():
    """Folded back by 180 degrees the outer bar's middle is 0.5 m from the first joint."""
    moments = gravity_moments(two_links(), np.array([[0.3, 0.0], [0.3, np.pi]]))
    np.testing.assert_allclose(moments[0], 9.81 * np.array([10 * 1.0 + 6 * 3.5, 6 * 1.5]))
    np.testing.assert_allclose(moments[1], 9.81 * np.array([10 * 1.0 + 6 * 0.5, 6 * 1.5]))


def test_the_ratio_is_one_where_nothing_shows_and_less_by_what_does():
    tree, q = two_links(), np.zeros((5, 2))
    orbit = np.arange(10.0).reshape(5, 2)
    np.testing.assert_allclose(unloading_ratio(tree, q, orbit, orbit), 1.0)
    off = orbit + np.array([1.0, -2.0])
    np.testing.assert_allclose(
        unloading_ratio(tree, q, off, orbit), [1 - 1 / (9.81 * 31), 1 - 2 / (9.81 * 9)], rtol=1e-12
    )


def test_hang_units_are_in_balance():
    """Vertical equilibrium of bar, plate and rods, one below the other."""
    rig = built_in_rig()
    forces = unit_forces(rig)
    assert set(forces) == {sling.name for sling in rig.slings}
    for sling in rig.slings:
        f = forces[sling.name]
        assert f["N_A"] == pytest.approx(f["N_B"] + BAR / 2)
        assert f["N_B"] == pytest.approx(f["N_C + N_D"] + PLATE)
        assert f["N_C + N_D"] == pytest.approx(f["N_C"] + f["N_D"]) == pytest.approx(sling.weight + 2 * ROD)
        assert f["N_C"] + f["N_F"] == pytest.approx(f["N_C + N_F"]) == pytest.approx(sling.weight)
        assert f["N_A"] == pytest.approx(sling.tension)


def test_a_flights_coverage_and_loads():
    measured = np.array([[1.0] * 7, [2.0] * 7])
    flown = Flight(np.arange(2.0), measured, np.ones((2, 7)), np.array([0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))
    np.testing.assert_allclose(flown.coverage, [0.5, 1, 1, 1, 1, 1, 1])
    assert int(np.argmax(flown.loads)) == 6
    assert flown.loads[0] == pytest.approx(1.5e-3)
