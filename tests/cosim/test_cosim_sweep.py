"""One sweep by itself: what a mass gets of a force whose course before the step is known, against closed forms."""

import numpy as np
import pytest

from snarelab.cosim.feedthrough import FeedThrough
from snarelab.cosim.hold import HOLDS
from snarelab.cosim.participant import Variable
from snarelab.cosim.participants.formula import Formula
from snarelab.cosim.participants.oscillator import LeftOscillator
from snarelab.cosim.sweep import Sweep
from snarelab.cosim.system import System

STEP, STIFFNESS = 0.1, 10.0
A, B, C = 4.0, -7.0, 30.0
"""Force A + B t + C t² [N, N/s, N/s²]."""


def force(t):
    return A + B * t + C * t**2


def pushed(stiffness, hold="quadratic"):
    """A kilogram on a spring, at rest in its origin, under a force; a step of it from any time, and its motion."""
    source = Formula([Variable("force", "output", "N")], lambda inputs, _: 0.0)
    system = System(
        {"source": source, "mass": LeftOscillator(substeps=20)},
        [("source.force", "mass.force")],
        parameters={"mass.stiffness": stiffness, "mass.position": 0.0},
    )
    for name, participant in system.participants.items():
        participant.initialize(0.0, system.parameters_of(name))
    sweep = Sweep(system, HOLDS[hold], FeedThrough(system), sequential=False)
    outputs = list(system.layout.outputs)

    def step(t):
        past = [np.where(np.array(outputs) == "source.force", force(t - k * STEP), 0.0) for k in range(3)]
        sweep(t, STEP, past, [STEP, STEP])
        return float(sweep.mean_inputs[0]), system.participants["mass"].outputs()

    return step


def test_momentum_gained_in_a_step_is_the_mean_of_the_force_times_the_step():
    """Of F = A + B t + C t² over [t, t + H]: its integral over H; a free kilogram gains that."""
    step, speed = pushed(0.0), 0.0
    for k in range(5):
        t = k * STEP
        exact = A + B * (t + STEP / 2) + C * ((t + STEP) ** 3 - t**3) / (3 * STEP)
        mean, (_, after) = step(t)
        assert mean == pytest.approx(exact, rel=1e-12)
        assert after - speed == pytest.approx(exact * STEP, rel=1e-12)
        speed = after


def test_the_mean_of_a_line_is_its_value_at_the_middle_of_the_step():
    step = pushed(0.0, hold="linear")
    slope = (force(0.3) - force(0.2)) / STEP
    assert step(0.3)[0] == pytest.approx(force(0.3) + slope * STEP / 2, rel=1e-12)


def test_a_free_mass_follows_a_quadratic_force_exactly():
    """Twice integrated: x = A t²/2 + B t³/6 + C t⁴/12, a polynomial that Runge and Kutta's method gets exactly."""
    step = pushed(0.0)
    for k in range(5):
        _, (x, _) = step(k * STEP)
        t = (k + 1) * STEP
        assert x == pytest.approx(A * t**2 / 2 + B * t**3 / 6 + C * t**4 / 12, rel=1e-11)


def test_an_oscillator_follows_a_quadratic_force_as_its_closed_solution_does():
    """x'' + w² x = A + B t + C t² from rest: a parabola and a swing at w that makes up for it at the start."""
    step, square = pushed(STIFFNESS), STIFFNESS
    w = np.sqrt(square)
    zero = A / square - 2 * C / square**2
    for k in range(20):
        _, (x, v) = step(k * STEP)
        t = (k + 1) * STEP
        course = zero + B / square * t + C / square * t**2
        assert x == pytest.approx(course - zero * np.cos(w * t) - B / square / w * np.sin(w * t), abs=1e-8)
        rate = B / square + 2 * C / square * t
        assert v == pytest.approx(rate + zero * w * np.sin(w * t) - B / square * np.cos(w * t), abs=1e-7)
