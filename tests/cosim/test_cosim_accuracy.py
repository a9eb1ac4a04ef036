"""Accuracy, order and stability of the master on two coupled oscillators, whose exact solution is known."""

import pytest

from bench.cosim_accuracy import HOLDS, SCHEMES, error, growth, orders

STEPS = [0.02, 0.01]


def test_ten_thousand_explicit_steps_with_the_midpoint_hold():
    assert error(1e-3) <= 2.3e-5


def test_ten_thousand_iterated_steps_with_the_midpoint_hold():
    assert error(1e-3, "gauss_seidel", iterate=True) <= 1.4e-5


def test_held_constant_the_same_steps_are_a_hundred_times_worse():
    assert error(2e-3, hold="constant") / 2 >= 100 * error(2e-3) / 4  # by their orders, that is at 1 ms


@pytest.mark.parametrize("iterate", [False, True])
@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_observed_order(scheme, hold, iterate):
    _, found = orders(STEPS, scheme, hold, iterate)
    expected = {"constant": 1, "midpoint": 2, "linear": 2, "quadratic": 3}[hold]
    assert abs(found[-1] - expected) < 0.1


@pytest.mark.parametrize("scheme", SCHEMES)
def test_weak_coupling_needs_no_iteration_unless_inputs_are_constant(scheme):
    assert growth(0.1, 1.0, scheme, "constant") > 1
    assert all(growth(0.1, 1.0, scheme, hold) <= 1 for hold in HOLDS if hold != "constant")


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("mass", [0.5, 1.0, 3.0])
def test_stiff_coupling_needs_iteration(scheme, mass):
    assert growth(1.0, mass, scheme) > 1
    assert growth(1.0, mass, scheme, iterate=True) <= 1


def test_iterated_midpoint_is_stable_however_stiff_the_coupling():
    assert all(growth(stiffness, 1.0, iterate=True) <= 1 for stiffness in (0.1, 1.0, 10.0, 100.0))
