"""The servo study (BAM, XL330): its simulator against closed forms and another integrator, and recordings."""

from dataclasses import replace

import numpy as np
import pytest
from real_recordings import real_recordings

from snarelab.errors import InputError
from snarelab.studies import bam, bam_naming, bam_servo
from snarelab.studies.bam_naming import START, LawTrial, ServoFit, best, evolve, fit, name_missing, rms
from snarelab.studies.bam_servo import DUTY, GRAVITY, ServoRun, position_error, read_run, simulate

MASS, LENGTH = 0.49, 0.1
WEIGHT = MASS * GRAVITY * LENGTH


def run_of(goal, start=0.0, gain=400.0, on=1.0, duration=2.0, period=0.005):
    time = np.arange(0.0, duration, period)
    position = np.full(len(time), start)
    constant = [np.full(len(time), x) for x in (on, 7.4, 0.0)]
    return ServoRun("made.json", "made", gain, MASS, LENGTH, time, position, goal(time), *constant)


def other_integrator(run, torque_per_volt, back_emf, inertia, viscous, level, coefficient, step=1e-4):
    """Explicit steps of 0.1 ms, friction clipped to what stops the joint (as the publishers simulate it); positions."""
    times = np.arange(run.time[0], run.time[-1], step)
    q, v, a, found = run.position[0], 0.0, 0.0, []
    own = MASS * LENGTH**2
    for t in times:
        found.append(q)
        k = int(np.searchsorted(run.time, t + 1e-12, side="right")) - 1
        duty = min(1.0, max(-1.0, DUTY * run.gain * (run.goal[k] - q)))
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
    q = simulate(run, {"rotor_inertia": 0.001})
    crossings = np.flatnonzero(np.diff(np.sign(q)) != 0)
    half = np.mean(np.diff(run.time[crossings]))
    expected = np.pi * np.sqrt((MASS * LENGTH**2 + 0.001) / WEIGHT) * (1 + 0.05**2 / 16)
    assert half == pytest.approx(expected, rel=2e-3)
    assert np.abs(q[-500:]).max() == pytest.approx(0.05, rel=0.02)


def test_servo_settles_where_drive_and_weight_balance():
    values = {"torque_per_volt": 0.08, "back_emf": 0.4, "viscous_friction.coefficient": 0.05, "rotor_inertia": 0.001}
    q = simulate(run_of(lambda t: np.full_like(t, 0.5), duration=8.0), values)[-1]
    assert 0.08 * 7.4 * DUTY * 400 * (0.5 - q) == pytest.approx(WEIGHT * np.sin(q), rel=1e-4)


def test_friction_holds_up_to_its_level_and_no_further():
    values = {"rotor_inertia": 0.001, "viscous_friction.coefficient": 0.02}
    run = run_of(lambda t: 0 * t, start=0.3, on=0.0)
    weight = WEIGHT * np.sin(0.3)
    assert np.ptp(simulate(run, {**values, "coulomb_friction.level": 1.02 * weight})) == 0.0
    assert np.ptp(simulate(run, {**values, "coulomb_friction.level": 0.98 * weight})) > 1e-3
    # Friction in proportion to the load holds any load, or none.
    assert np.ptp(simulate(run, {**values, "load_dependent_friction.coefficient": 1.02})) == 0.0
    assert np.ptp(simulate(run, {**values, "load_dependent_friction.coefficient": 0.9})) > 1e-3


def test_agrees_with_another_integrator():
    run = run_of(lambda t: 1.2 * np.sin(3 * t) * np.sin(0.7 * t), duration=5.0)
    named = ("torque_per_volt", "back_emf", "rotor_inertia", "viscous_friction.coefficient", "coulomb_friction.level")
    numbers = (0.08, 0.38, 0.0014, 0.004, 0.005)
    values = {**dict(zip(named, numbers, strict=True)), "load_dependent_friction.coefficient": 0.4}
    other = other_integrator(run, *numbers, 0.4)
    assert np.sqrt(np.mean((simulate(run, values) - other) ** 2)) < 0.01 * np.sqrt(np.mean(other**2))


@pytest.fixture(scope="module")
def concealed():
    """Three gains of a servo whose friction depends on its load, by the other integrator."""
    runs = []
    for gain in (200.0, 400.0, 800.0):
        run = run_of(lambda t: 1.2 * np.sin(3 * t) * np.sin(0.7 * t), gain=gain, duration=3.0)
        runs.append(replace(run, position=other_integrator(run, 0.08, 0.38, 0.0014, 0.004, 0.005, 0.4, 2e-4)))
    return runs


def test_concealed_load_dependence_is_named_with_its_size(concealed, monkeypatch):
    for name in ("FEWER", "EVALUATIONS"):
        monkeypatch.setattr(bam_naming, name, 60)
    base = fit(concealed, {k: v for k, v in START.items() if k != "zero"}, 0)
    first = next(iter(name_missing(concealed, base)))
    assert first.named is not None
    assert first.named.name == "load_dependent_friction"
    assert first.named.explained > 0.9
    assert first.named.fit.values["load_dependent_friction.coefficient"] == pytest.approx(0.4, rel=0.15)
    assert bam.confirmed(base, first.named.fit, concealed)
    assert not bam.confirmed(first.named.fit, first.named.fit, concealed)


def test_evolution_finds_a_bent_valley_within_bounds():
    def banana(x):
        return float((1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2)

    assert evolve(banana, np.zeros(2), np.full(2, -5.0), 2000, 0) == pytest.approx([1, 1], abs=0.01)
    assert evolve(banana, np.zeros(2), np.array([-5.0, 1.44]), 2000, 0) == pytest.approx([1.2, 1.44], abs=0.01)


def test_damaged_recording_is_named(tmp_path):
    path = tmp_path / "broken.json"
    path.write_text('{"kp": 100, "entries": []}')
    with pytest.raises(InputError, match=r"broken\.json: is no recording of the servo"):
        read_run(path)


@pytest.fixture(scope="module")
def recorded():
    """All runs: those to fit, and those at gain 400."""
    runs = [read_run(path) for path in sorted(real_recordings("bam/xl330", "*.json").glob("*.json"))]
    return [r for r in runs if r.gain != 400], [r for r in runs if r.gain == 400]


def test_duty_is_what_the_firmware_makes_of_it(recorded):
    assert len(recorded[0]) == 12
    assert bam.duty_error([*recorded[0], *recorded[1]]) < 0.01  # a sample's lag of a moving joint; full duty is 1


def test_steps_are_fine_enough(recorded, monkeypatch):
    values = {**bam.PUBLISHED, "load_dependent_friction.coefficient": 0.3}
    coarse = position_error(recorded[1], values)
    monkeypatch.setattr(bam_servo, "SUBSTEPS", 16)
    assert position_error(recorded[1], values) == pytest.approx(coarse, rel=0.02)


def tried(name, parameters, score, *forecast):
    """A law with so many parameters, that explains a half."""
    return LawTrial(
        name, ServoFit(dict.fromkeys(map(str, range(parameters)), 0.0), 0.1), 0.5, dict(enumerate(forecast)), score
    )


def test_of_scores_as_good_as_equal_the_fewest_parameters_are_named():
    """One gain predicted a little worse says nothing, and turns with the last digits of a fit that sticks."""
    load, position = tried("load", 7, 42.4, 0.5, 0.7, -0.025), tried("position", 9, 42.6, 0.6, 0.7, -0.045)
    assert best([position, load]) is load
    assert best([load, better := tried("position", 9, 45.0, 0.6, 0.7, 0.1)]) is better
    assert best([load, tried("ripple", 6, 35.0, 0.5, 0.5, 0.3)]) is load  # simpler, and much worse
    worse = tried("load", 7, 42.4, 0.5, 0.7, -0.06)
    assert best([worse, position]) is position
    assert best([worse, tried("ripple", 9, -1.0, 0.5, 0.5, 0.3)]) is None


@pytest.mark.slow
def test_load_dependence_takes_a_third_of_the_held_out_error(recorded):
    train, held = recorded
    base = fit(train, START, 0)
    richer = fit(train, {**base.values, "load_dependent_friction.coefficient": 0.1})  # to the end, as the study does
    before, after = (position_error(held, f.values) for f in (base, richer))
    assert before == pytest.approx(bam.CHECK["coulomb_and_viscous"], rel=0.1)
    assert after <= 2 / 3 * before
    assert rms(held, richer.values) < 2 / 3 * rms(held, base.values)
