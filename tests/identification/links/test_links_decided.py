"""What the evidence names between two encoders of one joint, and nothing where encoders do no more than they always do.

Faults are put in by plain arithmetic, drives by an ODE solver of SciPy's."""

import numpy as np
import pytest
from encoder_pairs import RATE, links, run
from scipy.integrate import solve_ivp

from snarelab.identification.sources.answer import rms
from snarelab.identification.sources.decide import decide
from snarelab.identification.sources.source import ModelPoint

N = 640
TIME = np.arange(N) / RATE
NOISE = 1e-5
INERTIA = 2.0
"""[kg·m²] On 3000 N·m/rad it rings at 6 Hz, which 64 samples a second resolve."""


def angle(t, phase=0.0):
    return 0.25 * (np.sin(2.1 * t + phase) + 0.3 * np.sin(5.3 * t + 2 * phase))


def torque(t, phase=0.0):
    return 6.0 * np.sin(1.3 * t + phase) + 2.0 * np.sin(9.0 * t - phase)


def twist(t, load, stiffness, damping, gap):
    """Of a link behind a spring and a damper with a gap, by an adaptive Runge-Kutta method."""

    def rate(at, x):
        beyond = x[0] - np.clip(x[0], -gap / 2, gap / 2)
        return x[1], (load(at) - damping * x[1] - stiffness * beyond) / INERTIA

    start = load(t[0]) / stiffness + np.sign(load(t[0])) * gap / 2
    return solve_ivp(rate, (t[0], t[-1]), (start, 0.0), t_eval=t, rtol=1e-8, atol=1e-12, max_step=0.01).y[0]


def decided(*differences, seed=0, noise=NOISE):
    """Three recordings, the last held out, of which each has the sum of these differences and white noise."""
    rng, runs = np.random.default_rng(seed), []
    for number in range(3):
        q, load = angle(TIME, number), torque(TIME, number)
        own = sum((f(TIME, q, number) for f in differences), noise * rng.standard_normal(N))
        runs.append(run(q, own, load=load, inertia=INERTIA, path=f"/data/{number}.csv"))
    one = links(*runs, n_train=2)
    return decide(one, ModelPoint.of((), {}, one.n_shifts))


def named(found):
    return sorted(n.placed.key for n in found.best.names)


@pytest.mark.parametrize("step", [0.0, 2e-5, 1e-4])
def test_noise_and_steps_of_the_encoders_alone_have_no_name(step):
    """Steps of both encoders, from a tenth of what they differ by in a spring to far above the noise."""

    def steps(t, q, number):
        if not step:
            return 0.0
        link = q + 1e-3 / 3
        return (np.round(link / step) - np.round(q / step)) * step - 1e-3 / 3

    found = decided(steps, seed=7, noise=NOISE if not step else 0.1 * step)
    assert named(found) == []
    assert found.left.curves == ()


def test_a_spring_is_named_with_its_stiffness_and_leaves_the_noise():
    found = decided(lambda t, q, number: -twist(t, lambda at: torque(at, number), 3000.0, 40.0, 0.0))
    assert named(found) == ["joint_elasticity.joint1"]
    values = found.best.last.train.at.all_values
    assert values["joint_elasticity.joint1.stiffness"] == pytest.approx(3000.0, rel=0.01)
    assert rms(found.best.last.held)[0] == pytest.approx(NOISE, rel=0.15)
    assert found.left.curves == ()


@pytest.mark.slow
def test_play_is_named_with_its_gap_beside_its_spring():
    """A gap of 1 mrad on a spring that twists by 2 mrad."""
    found = decided(lambda t, q, number: -twist(t, lambda at: torque(at, number), 3000.0, 60.0, 1e-3))
    assert "backlash.joint1" in named(found)
    assert set(named(found)) <= {"backlash.joint1", "joint_elasticity.joint1"}
    assert found.best.last.train.at.all_values["backlash.joint1.gap"] == pytest.approx(1e-3, rel=0.05)


def test_gain_and_drift_are_both_named_with_their_sizes():
    """And a zero that is another in each recording has no name."""
    found = decided(lambda t, q, number: 0.002 * q - 3e-5 * t + 0.01 * number - 0.004)
    assert named(found) == ["sensor_drift.q_link.joint1", "sensor_gain.q_link.joint1"]
    values = found.best.last.train.at.all_values
    assert values["sensor_gain.q_link.joint1.error"] == pytest.approx(0.002, rel=0.01)
    assert values["sensor_drift.q_link.joint1.rate"] == pytest.approx(-3e-5, rel=0.05)


def test_a_fault_of_the_training_recordings_alone_is_not_named():
    found = decided(lambda t, q, number: 0.002 * q * (number < 2))
    assert "sensor_gain.q_link.joint1" not in named(found)
    assert "sensor_gain.q_link.joint1" in {n.placed.key for n in found.rejected}


def test_what_has_no_law_is_a_curve_over_what_it_runs_over():
    """A wave of the gear over the joint's position; the noise, learnt anew beside the curve, has none of it."""
    found = decided(lambda t, q, number: 2e-4 * np.cos(40 * q))
    assert named(found) == []
    assert "position" in found.left.curves[0].over
    assert found.left.curves[0].explained > 0.9
