"""The two halves of a chain: their equations against a plain Runge-Kutta march, and what they show and start from."""

import numpy as np
import pytest

from snarelab.cosim.participants.oscillator import LeftOscillator, RightOscillator

LEFT = {"mass": 2.0, "stiffness": 10.0, "damping": 0.7, "position": 0.3, "speed": -0.4}
RIGHT = LEFT | {"coupling_stiffness": 3.0, "coupling_damping": 0.5}
INPUTS = np.array([[1.5, -2.0], [0.6, 0.9], [-4.0, 2.0]])
"""Values, first and second derivatives of two inputs at the start of a step."""


def marched(accelerate, size, substeps, n_inputs):
    """Runge and Kutta's method with its four slopes on position, speed and inputs, of which each is the next's rate."""
    h = size / substeps
    z = np.concatenate([[0.3, -0.4], INPUTS[:, :n_inputs].ravel()])

    def rate(z):
        u, first, second = z[2:].reshape(3, n_inputs)
        return np.concatenate([[z[1], accelerate(z[0], z[1], u)], first, second, np.zeros(n_inputs)])

    for _ in range(substeps):
        a = rate(z)
        b = rate(z + h / 2 * a)
        c = rate(z + h / 2 * b)
        d = rate(z + h * c)
        z = z + h / 6 * (a + 2 * b + 2 * c + d)
    return z[:2], z[2 : 2 + n_inputs]


@pytest.mark.parametrize("substeps", [1, 3])
def test_the_left_mass_follows_its_spring_its_damper_and_the_force(substeps):
    """2 a = -10 x - 0.7 v + F."""
    half = LeftOscillator(substeps=substeps)
    half.initialize(0.0, LEFT)
    half.set_inputs(INPUTS[0, :1])
    half.set_input_derivatives(INPUTS[1, :1], INPUTS[2, :1])
    half.step(0.0, 0.2)
    end, _ = marched(lambda x, v, u: (-10 * x - 0.7 * v + u[0]) / 2, 0.2, substeps, 1)
    np.testing.assert_allclose(half.outputs(), end, rtol=1e-12)


@pytest.mark.parametrize("substeps", [1, 3])
def test_the_right_mass_is_drawn_by_the_coupling_and_shows_its_force(substeps):
    """2 a = -10 x - 0.7 v - F with F = 3 (x - x_left) + 0.5 (v - v_left), which acts on the left mass."""
    half = RightOscillator(substeps=substeps)
    half.initialize(0.0, RIGHT)
    half.set_inputs(INPUTS[0])
    half.set_input_derivatives(INPUTS[1], INPUTS[2])
    assert half.outputs() == pytest.approx([0.3, -0.4, 3 * (0.3 - 1.5) + 0.5 * (-0.4 + 2.0)])
    half.step(0.0, 0.2)
    (x, v), (x_left, v_left) = marched(
        lambda x, v, u: (-10 * x - 0.7 * v - 3 * (x - u[0]) - 0.5 * (v - u[1])) / 2, 0.2, substeps, 2
    )
    np.testing.assert_allclose(half.outputs(), [x, v, 3 * (x - x_left) + 0.5 * (v - v_left)], rtol=1e-12)


def test_inputs_are_held_until_they_are_told_to_move():
    """After a parabola, plain inputs: a free kilogram under 2 N for a second from rest goes 1 m."""
    half = LeftOscillator()
    half.initialize(0.0, {"stiffness": 0.0, "position": 0.0})
    half.set_inputs(np.array([7.0]))
    half.set_input_derivatives(np.array([5.0]), np.array([3.0]))
    half.set_inputs(np.array([2.0]))
    half.step(0.0, 1.0)
    np.testing.assert_allclose(half.outputs(), [1.0, 2.0], rtol=1e-12)


def test_steps_of_other_sizes_are_other_steps_and_a_saved_state_comes_back():
    half = LeftOscillator()
    half.initialize(0.0, {"stiffness": 0.0, "position": 0.0, "speed": 1.0})
    saved = half.save()
    for size in (0.5, 0.25, 0.5):
        half.step(0.0, size)
    assert half.outputs() == pytest.approx([1.25, 1.0])
    half.restore(saved)
    half.step(0.0, 0.25)
    assert half.outputs() == pytest.approx([0.25, 1.0])
    half.initialize(0.0, {"stiffness": 0.0, "position": 0.0, "speed": 2.0, "mass": 4.0})
    half.set_inputs(np.array([8.0]))
    half.step(0.0, 0.25)  # 2 m/s² on 2 m/s
    assert half.outputs() == pytest.approx([0.5 + 0.0625, 2.5])


@pytest.mark.parametrize(
    ("half", "first"), [(LeftOscillator, [1.0, 0.0]), (RightOscillator, [0.0, 0.0, 0.0])], ids=["left", "right"]
)
def test_what_they_show_at_first_is_what_they_say_and_they_are_alike(half, first):
    """The usual model of co-simulation: a kilogram on 10 N/m each, 3 N/m between them, no damping, one metre apart."""
    one = half()
    one.initialize()
    assert one.outputs() == pytest.approx(first)
    assert [v.start for v in one.variables if v.causality == "output"] == first
    given = {v.name: v.start for v in one.variables if v.causality == "parameter"}
    assert (given["mass"], given["stiffness"], given["damping"], given["speed"]) == (1.0, 10.0, 0.0, 0.0)
    assert given.get("coupling_stiffness", 3.0) == 3.0
    assert given.get("coupling_damping", 0.0) == 0.0
    least = {v.name: v.minimum for v in one.variables if v.causality == "parameter"}
    assert all(least[name] == 0 for name in least if "stiffness" in name or "damping" in name)
    assert 0 < least["mass"] < 1e-6
    assert (least["position"], least["speed"]) == (-np.inf, -np.inf)


def test_a_half_goes_by_its_kind_unless_it_is_named():
    assert (LeftOscillator().name, RightOscillator("far").name) == ("leftoscillator", "far")
