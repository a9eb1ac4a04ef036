"""What a cubic lacks: forces against their energy, the energy against short elements, and a bounce against them."""

# pyright: reportArgumentType=false

import numpy as np
import pytest

from snarelab.models.snare.bow import add_bow, bow_energy, give, lateral_pull
from snarelab.models.snare.cubic import combine, first_weights, second_weights
from snarelab.models.snare.energy import BENDING_POINTS, TENSION_POINTS
from snarelab.models.snare.law import force, hertz_overlap, lag, law_constants
from snarelab.models.snare.model import Accuracy, SnareModel
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.settled import settled
from snarelab.models.snare.target import Target

P = SnareParameters(cable_pretension=20.0)
SIZE = P.cable_length / 10


def bent_element(seed=0):
    """A bent, stretched and twisted one."""
    rng = np.random.default_rng(seed)
    element = settled(P, 10)[0, 2:4].reshape(4, 3).copy()
    return element + rng.normal(size=(4, 3)) * [[1e-4], [5e-3], [1e-4], [5e-3]]


def slopes(function, element, step):
    changes = step * np.eye(12).reshape(12, 4, 3)
    return np.array([(function(element + c) - function(element - c)) / (2 * step) for c in changes]).reshape(4, 3)


@pytest.mark.parametrize("seed", range(3))
def test_forces_are_the_slope_of_the_energy(seed):
    law, element = law_constants(P), bent_element(seed)
    forces = np.zeros((4, 3))
    add_bow(element, 1, SIZE, law, forces)
    found = slopes(lambda x: bow_energy(law, x, SIZE), element, 1e-7)
    np.testing.assert_allclose(forces, -found, atol=1e-6 * np.abs(found).max())


def test_slope_of_the_lateral_pull():
    law, element = law_constants(P), bent_element()
    gradient = np.empty((4, 3))
    lateral_pull(law, element, SIZE, gradient)
    found = slopes(lambda x: lateral_pull(law, x, SIZE, np.empty((4, 3)))[0], element, 1e-8)
    np.testing.assert_allclose(gradient, found, atol=1e-6 * np.abs(found).max())


def rest_energy(n_elements, bowed):
    """Of one cable at rest, by the elements' own points, and with ΔU [J]."""
    p = SnareParameters()
    size, total = p.cable_length / n_elements, 0.0
    for element in (settled(p, n_elements)[0, i : i + 2].reshape(4, 3) for i in range(n_elements)):
        for x, weight in TENSION_POINTS:
            stretch = np.linalg.norm(combine(first_weights(x, size), element))
            total += 0.5 * weight * size * p.axial_stiffness * (stretch - 1) ** 2
        for x, weight in BENDING_POINTS:
            tangent, bow = (np.array(combine(n(x, size), element)) for n in (first_weights, second_weights))
            curvature = np.linalg.norm(np.cross(tangent, bow)) / (tangent @ tangent)
            total += 0.5 * weight * size * p.bending_stiffness * curvature**2
        total += bow_energy(law_constants(p), element, size) if bowed else 0.0
    return total


@pytest.mark.slow
def test_energy_at_rest_is_that_of_the_elastica():
    """Of sixth order in the element's length with ΔU, of fourth without; ten elements are then as good as fifty."""
    exact = rest_energy(24, True)
    assert exact == pytest.approx(rest_energy(30, False), rel=5e-7)
    errors = [abs(rest_energy(n, True) - exact) for n in (6, 12)]
    assert np.log2(errors[0] / errors[1]) > 5.5
    assert abs(rest_energy(10, True) - exact) < 0.02 * abs(rest_energy(10, False) - exact)
    assert abs(rest_energy(10, True) - exact) < 5e-7 * exact


def test_a_bounce_is_the_same_with_few_elements_and_with_many():
    """A light and nearly smooth target: what it leaves with decides everything after."""
    target = Target("pendulum", position=(0.2369, 0.038, -0.038), mass=30.0)
    p = SnareParameters(friction=0.01)
    speeds = [SnareModel(p, target, Accuracy(5e-4, n, 2.5e-4)).run(5.6, 0.1).target_velocity[-1] for n in (10, 24)]
    assert np.linalg.norm(speeds[1]) > 5e-3  # it has been hit, and has left
    assert np.linalg.norm(speeds[0] - speeds[1]) < 1e-4 * np.linalg.norm(speeds[1])


def test_the_give_is_damped_as_the_cable_is():
    """Pressed at a steady rate, an element loses τ e ḟ² beside what Hertz's law with its own damping loses."""
    law = law_constants(P.with_values(contact_damping=0.0))
    soft, n, speed = give(law, 0.5, SIZE), (0.0, 0.0, 1.0), 1e-4
    x = hertz_overlap(law, -5e-6, soft)
    still, moving = (force(law, -5e-6, soft, n, (0.0, 0.0, -v))[2] for v in (0.0, speed))
    step = 1e-9
    rate = (force(law, -5e-6 - step, soft, n, (0.0, 0.0, 0.0))[2] - still) / step * speed
    assert (moving - still) * speed == pytest.approx(P.bending_damping * soft * rate**2, rel=1e-3)
    assert lag(law, x, 0.0) == 0  # at a node nothing gives
