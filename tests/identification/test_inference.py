"""Whole decisions by one evidence on what is told wrong today: a torque that wanders, and a motor that ripples."""

from functools import partial

import numpy as np
import pytest
from decided import decided, names
from pendulum import recorded
from scipy.signal import savgol_filter
from shaken import chattering

from snarelab.identification.fitting.experiment import load_experiments
from snarelab.identification.fitting.fit import channel_rms
from snarelab.models.model_file import load_model
from snarelab.models.rigid_body import RigidBody


def wander(path, seed, rms=0.3, rate=200):
    """Add a random walk of this RMS about its mean to the torque of a recording [N·m]."""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    walk = np.cumsum(np.random.default_rng(seed).normal(size=len(table)))
    table[:, 2] += rms * (walk - walk.mean()) / walk.std()
    np.savetxt(path, table, delimiter=",", header="time,q.joint1,tau.joint1", comments="", fmt="%.8g")


@pytest.mark.parametrize("seed", [11, 12])
def test_a_clean_pendulum_is_adequate(tmp_path, seed):
    found = decided(recorded(tmp_path, seed), tmp_path)
    assert found.verdict == "adequate", names(found)


@pytest.mark.parametrize("seed", [21, 22, 23])
def test_a_torque_that_wanders_is_no_physics(tmp_path, seed):
    model = recorded(tmp_path, seed)
    for number, name in enumerate(("train.csv", "hold.csv")):
        wander(tmp_path / name, 100 * seed + number)
    found = decided(model, tmp_path)
    assert not names(found)


@pytest.mark.parametrize("seed", [31, 32, 33])
def test_a_disturbance_without_high_frequencies_is_noise_with_its_size(tmp_path, seed):
    """0.3 N·m between 0.1 and 1 Hz, shaken at the joint inside its servo; noise of first order left it to physics."""
    found = decided(recorded(tmp_path, seed, edges=(0.1, 1.0)), tmp_path)
    assert not names(found)
    assert found.verdict == "adequate"
    (noise,) = found.found.weighed.noises
    assert noise.order == 2
    assert noise.coloured == pytest.approx(0.3, rel=0.25)


def bump(height, at, wide, q):
    return height * np.exp(-(((q - at) / wide) ** 2))


@pytest.mark.slow
def test_beside_a_law_without_a_name_nothing_is_named(tmp_path):
    """A bump of torque at one position, of 1 to 3 N·m on 20 pendulums: told where it is, and at most once with a name,
    though the noise is learnt again of what it leaves."""
    named, told = [], 0
    for seed in range(60, 80):
        folder = tmp_path / str(seed)
        folder.mkdir()
        height, at, wide = np.random.default_rng(seed).uniform((1.0, -0.4, 0.05), (3.0, 0.4, 0.2))
        found = decided(recorded(folder, seed, law=partial(bump, height, at, wide)), folder)
        named += [(seed, name) for name in names(found)]
        told += found.verdict == "unknown_effect"
    assert len(named) <= 1, named
    assert told >= 18


def shake(path, seed, size, hertz, rate=200):
    """A joint that chatters in its torque while it moves at a third to two thirds of its peak speed [N·m]."""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    speed = np.abs(np.asarray(savgol_filter(table[:, 1], 21, 2, deriv=1, delta=1 / rate)))
    at_pace = (speed > speed.max() / 3) & (speed < 2 * speed.max() / 3)
    table[:, 2] += size * chattering(np.random.default_rng(seed), at_pace, 1 / rate, hertz)
    np.savetxt(path, table, delimiter=",", header="time,q.joint1,tau.joint1", comments="", fmt="%.8g")


def chatters(folder, seed, again):
    """What is told of a joint that chatters at some speeds, in the held-out recording ``again`` or not."""
    folder.mkdir()
    model = recorded(folder, seed)
    for number, name in enumerate(("train.csv", "hold.csv") if again else ("train.csv",)):
        shake(folder / name, 10 * seed + number, 2.0, 5.0)
    return decided(model, folder)


def test_a_joint_that_chatters_at_some_speeds_is_told_by_its_frequency_if_it_does_again(tmp_path):
    found = chatters(tmp_path / "again", 81, again=True)
    assert not names(found)
    assert found.verdict == "unknown_effect"
    (told,) = found.left.vibrations.values()
    assert told.frequency == pytest.approx(5.0, rel=0.05)
    assert told.slow < 1 / 2 < told.fast
    found = chatters(tmp_path / "once", 81, again=False)
    assert not names(found)
    assert not found.left.vibrations


@pytest.mark.slow
def test_chatter_is_never_named_and_is_noise_where_few_passes_do_not_tell_its_speeds(tmp_path):
    told = 0
    for seed in range(82, 88):
        again, once = (chatters(tmp_path / f"{seed}{x}", seed, again=x) for x in (True, False))
        assert not names(again)
        assert not once.left.vibrations
        (noise,) = again.left.noises
        assert noise.vibration
        assert noise.vibration.frequency == pytest.approx(5.0, rel=0.05)
        told += bool(again.left.vibrations)
    assert told >= 2


def relative(fit, folder):
    """What a fit leaves of the held-out torque [share of it]."""
    model = load_model(folder / "motor.toml")
    held = load_experiments(model, [folder / "hold.csv"], RigidBody(model.tree))
    rms, measured = channel_rms(fit.assembly, held, fit.theta)
    return float(rms[0] / measured[0])


def motor(path, seed, seconds, ripple=1.0):
    """A rotor under a slow servo; its ripple makes most of what the torque is, so that 88 % of it is not modelled."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, seconds, 1 / 200)
    w, phase = 2 * np.pi * np.array([0.05, 0.11, 0.17]), rng.uniform(0, 2 * np.pi, 3)
    turn = w * t[:, None] + phase
    q, qd, qdd = (x.sum(axis=1) for x in (0.5 / w * np.sin(turn), 0.5 * np.cos(turn), -0.5 * w * np.sin(turn)))
    modelled = 0.05 * qdd + 0.3 * np.tanh(qd / 2e-3) + 0.1 * qd
    tau = modelled + ripple * np.cos(2 * np.pi * q / 0.4 + 0.7) + 0.05 * rng.normal(size=len(t))
    table = np.column_stack([t, q, tau])
    np.savetxt(path, table, delimiter=",", header="time,q.joint1,tau.joint1", comments="", fmt="%.9g")


def test_a_ripple_that_is_most_of_a_motors_torque_is_named(tmp_path):
    own = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="0.05"/></inertial>'
    (tmp_path / "motor.urdf").write_text(
        f'<robot name="motor"><link name="base"/><link name="link1">{own}</link><joint name="joint1" type="revolute">'
        '<parent link="base"/><child link="link1"/><axis xyz="0 0 1"/>'
        '<limit lower="-9" upper="9" velocity="5" effort="200"/></joint></robot>'
    )
    (tmp_path / "motor.toml").write_text(
        'name = "motor"\nsystem = "arm"\nurdf = "motor.urdf"\neffects = ["viscous_friction", "coulomb_friction"]\n'
    )
    motor(tmp_path / "train.csv", 1, 40.0)
    motor(tmp_path / "hold.csv", 2, 25.0)
    found = decided(load_model(tmp_path / "motor.toml"), tmp_path)
    assert names(found) == ["torque_ripple.joint1"]
    fit, without = found.best.last.fit, found.best.missed["torque_ripple.joint1"].fit.fit
    assert relative(without, tmp_path) > 0.8
    assert relative(fit, tmp_path) < 0.15
    period = fit.theta[[s.key for s in fit.assembly.slots].index("torque_ripple.joint1.period")]
    assert period == pytest.approx(0.4, rel=0.01)
