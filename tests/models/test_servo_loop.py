"""A position servo in its own closed loop, against closed forms and another integrator."""

import numpy as np
import pytest

from snarelab.models import servo_loop
from snarelab.models.effects import get_effect
from snarelab.models.servo_loop import GRAVITY, ServoRun, laws, simulate

MASS, LENGTH = 0.49, 0.1
WEIGHT = MASS * GRAVITY * LENGTH


def run_of(goal, start=0.0, gain=1.15, on=1.0, duration=2.0, period=0.005):
    time = np.arange(0.0, duration, period)
    position = np.full(len(time), start)
    constant = [np.full(len(time), x) for x in (on, 7.4)]
    return ServoRun("made.json", gain, MASS, LENGTH, time, position, goal(time), *constant)


def other_integrator(run, torque_per_volt, back_emf, inertia, viscous, level, coefficient, step=1e-4):
    """Explicit steps of 0.1 ms, friction clipped to what stops the joint (as the publishers simulate it); positions."""
    times = np.arange(run.time[0], run.time[-1], step)
    q, v, a, found = run.position[0], 0.0, 0.0, []
    own = MASS * LENGTH**2
    for t in times:
        found.append(q)
        k = int(np.searchsorted(run.time, t + 1e-12, side="right")) - 1
        duty = min(1.0, max(-1.0, run.gain * (run.goal[k] - q)))
        tau = run.on[k] * torque_per_volt * (duty * run.volts[k] - back_emf * v)
        weight = WEIGHT * np.sin(q)
        most = level + viscous * abs(v) + coefficient * abs(own * a + weight)
        stop = (own + inertia) * v / step + tau - weight
        a = (tau - weight - np.sign(stop) * min(abs(stop), most)) / (own + inertia)
        v += step * a
        q += step * v
    return np.interp(run.time, times, found)


def test_free_pendulum_keeps_its_period_and_energy():
    run = run_of(lambda t: 0 * t, start=0.05, on=0.0, duration=6.0, period=0.002)
    q = simulate(run, {"rotor_inertia.inertia": 0.001})
    crossings = np.flatnonzero(np.diff(np.sign(q)) != 0)
    half = np.mean(np.diff(run.time[crossings]))
    expected = np.pi * np.sqrt((MASS * LENGTH**2 + 0.001) / WEIGHT) * (1 + 0.05**2 / 16)
    assert half == pytest.approx(expected, rel=2e-3)
    assert np.abs(q[-500:]).max() == pytest.approx(0.05, rel=0.02)


def test_servo_settles_where_drive_and_weight_balance():
    values = {
        "servo_drive.torque_per_volt": 0.08,
        "servo_drive.back_emf": 0.4,
        "viscous_friction.coefficient": 0.05,
        "rotor_inertia.inertia": 0.001,
    }
    q = simulate(run_of(lambda t: np.full_like(t, 0.5), duration=8.0), values)[-1]
    assert 0.08 * 7.4 * 1.15 * (0.5 - q) == pytest.approx(WEIGHT * np.sin(q), rel=1e-4)


def test_friction_holds_up_to_its_level_and_no_further():
    values = {"rotor_inertia.inertia": 0.001, "viscous_friction.coefficient": 0.02}
    run = run_of(lambda t: 0 * t, start=0.3, on=0.0)
    weight = WEIGHT * np.sin(0.3)
    assert np.ptp(simulate(run, {**values, "coulomb_friction.level": 1.02 * weight})) == 0.0
    assert np.ptp(simulate(run, {**values, "coulomb_friction.level": 0.98 * weight})) > 1e-3
    # Friction in proportion to the load holds any load, or none.
    assert np.ptp(simulate(run, {**values, "load_dependent_friction.coefficient": 1.02})) == 0.0
    assert np.ptp(simulate(run, {**values, "load_dependent_friction.coefficient": 0.9})) > 1e-3


def test_agrees_with_another_integrator():
    run = run_of(lambda t: 1.2 * np.sin(3 * t) * np.sin(0.7 * t), duration=5.0)
    named = (
        "servo_drive.torque_per_volt",
        "servo_drive.back_emf",
        "rotor_inertia.inertia",
        "viscous_friction.coefficient",
        "coulomb_friction.level",
    )
    numbers = (0.08, 0.38, 0.0014, 0.004, 0.005)
    values = {**dict(zip(named, numbers, strict=True)), "load_dependent_friction.coefficient": 0.4}
    other = other_integrator(run, *numbers, 0.4)
    assert np.sqrt(np.mean((simulate(run, values) - other) ** 2)) < 0.01 * np.sqrt(np.mean(other**2))


def test_steps_are_fine_enough(monkeypatch):
    run = run_of(lambda t: 1.2 * np.sin(3 * t) * np.sin(0.7 * t), duration=5.0)
    values = {"servo_drive.torque_per_volt": 0.07, "servo_drive.back_emf": 0.32, "rotor_inertia.inertia": 0.0016,
              "coulomb_friction.level": 0.007, "load_dependent_friction.coefficient": 0.3}  # fmt: skip
    coarse = simulate(run, values)
    monkeypatch.setattr(servo_loop, "SUBSTEPS", 16)
    assert np.std(simulate(run, values) - coarse) < 0.01 * np.std(coarse)


def test_its_laws_are_those_of_position_speed_and_load():
    """No list: whatever the vocabulary has for a joint without memory."""
    names = {e.name for e in laws()}
    assert {"viscous_friction", "coulomb_friction", "torque_ripple", "gear_efficiency", "makkar_friction"} <= names
    for memory in ("backlash", "joint_elasticity", "presliding_hysteresis", "rotor_inertia", "joint_spring"):
        assert get_effect(memory) not in laws()
