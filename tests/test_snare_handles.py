"""Handles by which a search turns a capture's parameters, and the units in which its answer tells sizes."""

import pytest

from snarelab.identification.snare.answer import _size
from snarelab.identification.snare.handles import Handle


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
