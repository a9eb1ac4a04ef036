"""Handles by which a search turns a capture's parameters, and the units in which its answer tells sizes."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from snarelab.identification.snare.answer import _size
from snarelab.identification.snare.handles import HANDLES, Handle, bounds, free, steps, values_of
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect


def handle(scale):
    return Handle(scale, -3.0, 3.0, 0.1, ())


@pytest.mark.parametrize(
    ("scale", "value", "x"),
    [
        ("root", 0.25, 0.5),
        ("root", 400.0, 20.0),
        ("root", 0.0, 0.0),
        ("log", 100.0, 2.0),
        ("log", 0.01, -2.0),
        ("plain", -0.7, -0.7),
    ],
)
def test_a_handle_stands_at_the_root_the_power_of_ten_or_the_value_itself(scale, value, x):
    assert handle(scale).x(value) == pytest.approx(x, abs=1e-15)
    assert handle(scale).value(x) == pytest.approx(value, abs=1e-15)


def test_a_value_below_zero_has_no_root_and_stands_at_zero():
    assert handle("root").x(-0.5) == 0.0


@pytest.mark.parametrize("value", [0.0, 1e-9])
def test_a_value_below_what_a_power_of_ten_reaches_stands_at_the_lower_bound(value):
    assert handle("log").x(value) == pytest.approx(-3.0)


def test_metres_are_told_in_millimetres_and_other_units_as_they_are():
    assert _size(0.01234, "m") == "12.3 mm"
    assert _size(4.561, "N") == "4.56 N"
    assert _size(0.02, "rad") == "0.02 rad"


@pytest.mark.parametrize(
    ("scale", "x", "slope"),
    [
        ("plain", 0.7, 1.0),
        ("root", 0.7, 2 * 0.7 + 0.1),  # ((x + s)² - x²)/s
        ("root", -0.7, 2 * 0.7 - 0.1),
        ("log", 2.0, 100 * (10**0.1 - 1) / 0.1),
    ],
)
def test_a_slope_is_the_size_of_the_values_difference_over_one_step(scale, x, slope):
    assert handle(scale).slope(x) == pytest.approx(slope, rel=1e-9)


@pytest.mark.parametrize("name", HANDLES)
def test_tries_stand_inside_the_bounds_and_differences_apart(name):
    """A candidate is tried at values, all of which a fit could reach, and that are not one and the same to it."""
    own = HANDLES[name]
    at = sorted(own.x(value) for value in own.tries)
    assert own.low + own.step < at[0]
    assert at[-1] < own.high - own.step
    assert all(b - a > 2 * own.step for a, b in pairwise(at))
    assert 8 * own.step < own.high - own.low  # what a climb may go in one step


def test_bounds_steps_and_freedom_come_in_the_order_of_the_effects():
    friction = PlacedEffect(get_effect("contact_friction"), "pin")
    umbilical = PlacedEffect(get_effect("umbilical_stiffness"), "target")
    held = replace(friction, hold=("coefficient",))
    low, high = bounds([umbilical, held])
    assert (low.tolist(), high.tolist()) == ([0.0, 0.0], [100.0, 1.5])
    assert steps([umbilical, held]).tolist() == [1.0, 0.03]
    assert free([umbilical, held, friction]).tolist() == [True, False, True]
    assert values_of([umbilical, friction], np.array([10.0, 0.2])) == pytest.approx(
        {"umbilical_stiffness.target.stiffness": 100.0, "contact_friction.pin.coefficient": 0.2}
    )
    assert [x.shape for x in (*bounds([]), steps([]), free([]))] == [(0,)] * 4
