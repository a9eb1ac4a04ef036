"""The independent plant, against Drake, closed forms and conservation laws."""

# pyright: reportAttributeAccessIssue=false
import importlib.util
import json
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from scipy.interpolate import make_interp_spline

sys.path.append(str(Path(__file__).resolve().parents[2]))

from bench.arm import Arm, Link, random_arm
from bench.lugre import LuGre
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Disturbance, Drift, Elasticity, Harness, Payload, Ripple, Servo, SolverFriction


class Drake:
    """The arm's URDF in Drake."""

    def __init__(self, arm):
        self.plant = MultibodyPlant(0.0)
        Parser(self.plant).AddModelsFromString(arm.urdf(), "urdf")
        self.plant.WeldFrames(self.plant.world_frame(), self.plant.GetFrameByName("base"))
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()

    def torque(self, q, qd, qdd):
        out = np.empty_like(q)
        for k in range(len(q)):
            self.plant.SetPositions(self.context, q[k])
            self.plant.SetVelocities(self.context, qd[k])
            forces = MultibodyForces(self.plant)
            self.plant.CalcForceElementsContribution(self.context, forces)
            out[k] = self.plant.CalcInverseDynamics(self.context, qdd[k], forces)
        return out

    def energies(self, q, qd):
        out = np.empty((len(q), 2))
        for k in range(len(q)):
            self.plant.SetPositions(self.context, q[k])
            self.plant.SetVelocities(self.context, qd[k])
            out[k] = self.plant.CalcKineticEnergy(self.context), self.plant.CalcPotentialEnergy(self.context)
        return out.T


def columns(recording, signal, arm):
    return np.column_stack([recording[f"{signal}.{joint}"] for joint in arm.joints])


def motion_of(recording, arm):
    spline = make_interp_spline(recording["time"], columns(recording, "q", arm), k=5)
    return tuple(spline(recording["time"], order) for order in range(3))


def one_joint(kind):
    return Arm((Link(kind, np.zeros(3), np.zeros(3), np.eye(3)[2], 5.0, np.zeros(3), 0.05 * np.eye(3), 2.0, 2.0),))


def ramp_to(speed, rise=0.5):
    """From rest to a constant speed."""

    def motion(time):
        s = np.clip(time / rise, 0.0, 1.0)
        q = speed * (rise * (s**3 - s**4 / 2.0) + np.maximum(time - rise, 0.0))
        return q[:, None], speed * (3 * s**2 - 2 * s**3)[:, None], speed * (6 * (s - s**2) / rise)[:, None]

    return motion


def rest(time):
    return np.zeros((len(time), 1)), np.zeros((len(time), 1)), np.zeros((len(time), 1))


@pytest.mark.parametrize("seed", range(8))
def test_urdf_and_mjcf_are_the_same_robot(seed):
    rng = np.random.default_rng(seed)
    arm = random_arm(rng, 1 + seed, prismatic_share=0.3).with_payload(1.5, (0.1, -0.2, 0.3))
    arm = arm.with_com_offset("link1", (0.01, 0.02, -0.03))
    model = mujoco.MjModel.from_xml_string(arm.mjcf())
    data = mujoco.MjData(model)
    q, qd, qdd = rng.uniform(-2.0, 2.0, (3, 20, model.nv))
    theirs = Drake(arm).torque(q, qd, qdd)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(data.qfrc_inverse, theirs[k], rtol=0, atol=1e-9)


def test_a_payload_is_a_point_mass():
    arm = random_arm(np.random.default_rng(0), 2)
    point, mass = np.array([0.1, 0.05, 0.4]), 3.0
    last, loaded = arm.links[-1], arm.with_payload(mass, point).links[-1]

    def about_frame(link):
        return link.inertia + link.mass * (link.com @ link.com * np.eye(3) - np.outer(link.com, link.com))

    added = about_frame(loaded) - about_frame(last)
    np.testing.assert_allclose(added, mass * (point @ point * np.eye(3) - np.outer(point, point)), atol=1e-12)
    assert loaded.mass == pytest.approx(last.mass + mass)


@pytest.mark.parametrize(("make", "duration"), [(fourier_motion, 2), (fourier_motion, 15), (point_to_point_motion, 15)])
def test_a_motion_is_its_own_derivative_within_limits_and_at_rest_at_both_ends(make, duration):
    arm = random_arm(np.random.default_rng(1), 5, prismatic_share=0.3)
    motion = make(arm, np.random.default_rng(2), duration)
    time = np.arange(round(duration * 1e4) + 1) * 1e-4
    q, qd, qdd = motion(time)
    np.testing.assert_allclose(q - q[0], np.cumsum(qd, axis=0) * 1e-4 - qd * 0.5e-4, atol=1e-5)
    np.testing.assert_allclose(qd, np.cumsum(qdd, axis=0) * 1e-4 - qdd * 0.5e-4, atol=1e-3)
    np.testing.assert_allclose([q[0], q[-1], qd[0], qd[-1]], 0.0, atol=1e-9)
    assert (np.abs(q).max(axis=0) <= [link.travel for link in arm.links]).all()
    assert (np.abs(qd).max(axis=0) <= [link.speed for link in arm.links]).all()
    assert (np.abs(qd).max(axis=0) > 0.2 * np.array([link.speed for link in arm.links])).all()


def test_a_bare_plant_obeys_the_rigid_body_and_its_channels_are_not_skewed():
    arm = random_arm(np.random.default_rng(3), 4)
    recording = simulate(
        Plant(arm), fourier_motion(arm, np.random.default_rng(4), 5.0), 5.0, 1000, np.random.default_rng(0)
    )
    tau = columns(recording, "tau", arm)[20:-20]
    error = tau - Drake(arm).torque(*motion_of(recording, arm))[20:-20]
    slope = np.gradient(tau, 1e-3, axis=0)
    assert (error.std(axis=0) < 1e-3 * tau.std(axis=0)).all()
    assert (np.abs((error * slope).sum(axis=0) / (slope**2).sum(axis=0)) < 1e-4).all()


def test_the_energy_error_of_a_free_fall_vanishes_with_the_step():
    arm = random_arm(np.random.default_rng(5), 3)

    def dropped(time):
        return np.full((len(time), 3), 0.3), np.zeros((len(time), 3)), np.zeros((len(time), 3))

    errors = []
    for timestep in (2.5e-4, 1.25e-4):
        plant = Plant(arm, servo=None)
        recording = simulate(plant, dropped, 2.0, 1000, np.random.default_rng(0), settle=0.0, timestep=timestep)
        assert not columns(recording, "tau", arm).any()
        q, qd, _ = motion_of(recording, arm)
        kinetic, potential = Drake(arm).energies(q[10:-10], qd[10:-10])
        assert kinetic.max() > 200.0
        errors.append((kinetic + potential - kinetic[0] - potential[0]) / kinetic.max())
    assert np.abs(errors[1]).max() < 0.01
    assert np.abs(2.0 * errors[1] - errors[0]).max() < 4e-4  # extrapolated to no step at all


@pytest.mark.parametrize("speed", [0.02, 0.06, 0.5, -0.02, -0.06, -0.5])
def test_lugre_at_constant_speed_is_its_closed_form(speed):
    law = LuGre(level=8, static=11, stribeck_speed=0.05, viscous=3, level_negative=6, viscous_negative=2)
    # A rotor heavy enough for a servo that outweighs the falling branch: no stick-slip.
    plant = Plant(one_joint("revolute"), friction={"joint1": law}, armature={"joint1": 5.0}, servo=Servo(bandwidth=10))
    recording = simulate(plant, ramp_to(speed), 2.5, 200, np.random.default_rng(0), settle=0.1)
    level, static, viscous = (8, 11, 3) if speed > 0 else (6, 8.25, 2)
    expected = np.sign(speed) * (level + (static - level) * np.exp(-((speed / 0.05) ** 2))) + viscous * speed
    assert recording["tau.joint1"][-40:].mean() == pytest.approx(expected, rel=2e-3)


def test_friction_that_grows_with_the_load_handed_to_the_link():
    law = LuGre(level=10, load_factor=0.2)
    plant = Plant(one_joint("prismatic"), friction={"joint1": law}, armature={"joint1": 20.0})
    for speed in (0.5, -0.5):
        recording = simulate(plant, ramp_to(speed, rise=0.3), 1.0, 1000, np.random.default_rng(0))
        qdd = motion_of(recording, plant.arm)[2][:, 0]
        load = 5.0 * (qdd + 9.81)
        expected = load + 20.0 * qdd + np.sign(speed) * (10 + 0.2 * np.abs(load))
        np.testing.assert_allclose(recording["tau.joint1"][140:-20], expected[140:-20], atol=0.3)


def test_friction_that_changes_along_the_travel():
    law = LuGre(level=10, variation=0.3, period=0.5)
    plant = Plant(one_joint("revolute"), friction={"joint1": law}, servo=Servo(bandwidth=15))
    recording = simulate(plant, ramp_to(0.5), 3.0, 200, np.random.default_rng(0))
    cruise = recording["time"] > 1.0
    expected = 10 + 3 * np.sin(2 * np.pi * recording["q.joint1"][cruise] / 0.5)
    np.testing.assert_allclose(recording["tau.joint1"][cruise], expected, atol=0.1)


def test_a_stuck_joint_stays_and_a_light_link_on_stiff_bristles_is_stable():
    light = Arm(
        (Link("revolute", np.zeros(3), np.zeros(3), np.eye(3)[0], 1.0, np.array([0, 0.2, 0]), 1e-4 * np.eye(3), 2, 2),)
    )
    plant = Plant(light, friction={"joint1": LuGre(level=5.0, deflection=2e-5)}, servo=None)
    recording = simulate(plant, rest, 2.0, 200, np.random.default_rng(0), settle=0.0)
    assert np.abs(recording["q.joint1"]).max() < 2e-5
    assert np.ptp(recording["q.joint1"][-100:]) < 1e-9


def test_friction_of_the_constraint_solver_slides_at_its_level():
    plant = Plant(
        one_joint("revolute"), friction={"joint1": SolverFriction(level=6, viscous=2)}, servo=Servo(bandwidth=15)
    )
    recording = simulate(plant, ramp_to(-0.5), 2.0, 200, np.random.default_rng(0))
    assert recording["tau.joint1"][-40:].mean() == pytest.approx(-7.0, rel=5e-3)


def test_springs_ripple_and_rotor():
    arm, weight = one_joint("prismatic"), 5.0 * 9.81
    drive = {"armature": {"joint1": 10.0}, "servo": Servo(bandwidth=10)}
    for gap in (0.0, 0.002):
        plant = Plant(arm, elasticity={"joint1": Elasticity(2e4, 50.0, gap)}, **drive)
        recording = simulate(plant, rest, 0.5, 200, np.random.default_rng(0), link_encoder=True)
        sag = recording["q.joint1"][-1] - recording["q_link.joint1"][-1]
        assert sag == pytest.approx(weight / 2e4 + gap / 2.0, rel=1e-3)
    plant = Plant(arm, harness={"joint1": Harness(40.0, rest=0.1)}, ripple={"joint1": Ripple(3.0, 20.0, 0.4)}, **drive)
    recording = simulate(plant, ramp_to(0.2), 4.0, 200, np.random.default_rng(0))
    q, qdd = (part[:, 0] for part in motion_of(recording, arm)[::2])
    expected = weight + (5.0 + 10.0) * qdd + 40.0 * (q - 0.1) - 3.0 * np.sin(20.0 * q + 0.4)
    np.testing.assert_allclose(recording["tau.joint1"][20:-20], expected[20:-20], atol=0.05)


def test_payload_and_mass_offset_weigh_on_the_plant_but_not_on_the_urdf():
    arm = random_arm(np.random.default_rng(6), 2)
    plant = Plant(arm, payload=Payload(4.0, (0.1, 0.0, 0.3)), com_offset={"link1": (0.05, 0.0, 0.02)})
    real = arm.with_payload(4.0, (0.1, 0.0, 0.3)).with_com_offset("link1", (0.05, 0.0, 0.02))
    recording = simulate(plant, fourier_motion(arm, np.random.default_rng(7), 4.0), 4.0, 1000, np.random.default_rng(0))
    tau, moved = columns(recording, "tau", arm), motion_of(recording, arm)
    right, wrong = (np.abs(tau - Drake(a).torque(*moved))[20:-20].max() for a in (real, plant.arm))
    assert right < 0.1 < 5.0 < wrong


def test_the_torque_channel_delays_biases_drifts_and_scales():
    arm = random_arm(np.random.default_rng(8), 2)
    motion = fourier_motion(arm, np.random.default_rng(9), 6.0)
    plain = simulate(Plant(arm), motion, 6.0, 1000, np.random.default_rng(1))
    plant = Plant(
        arm,
        tau_delay={"joint1": 0.012, "joint2": 0.0035},
        tau_gain={"joint2": 1.1},
        tau_bias={"joint2": -2.0},
        tau_drift={"joint2": Drift(5.0, 2.0)},
    )
    late = simulate(plant, motion, 6.0, 1000, np.random.default_rng(1))
    for name in ("q.joint1", "q.joint2"):
        np.testing.assert_array_equal(late[name], plain[name])
    before, after = (r["tau.joint1"][100:-100] - r["tau.joint1"].mean() for r in (plain, late))
    lags = np.arange(-40, 41)
    match = [np.sum((np.roll(before, lag) - after)[40:-40] ** 2) for lag in lags]
    assert lags[np.argmin(match)] == 12
    time, true = plain["time"], plain["tau.joint2"]
    expected = 1.1 * np.interp(time - 0.0035, time, true) - 2.0 + 5.0 * (1 - np.exp(-time / 2.0))
    np.testing.assert_allclose(late["tau.joint2"][5:], expected[5:], atol=1e-9)


def test_noise_has_its_rms_and_readings_their_quantum():
    arm = random_arm(np.random.default_rng(10), 2)
    motion = fourier_motion(arm, np.random.default_rng(11), 4.0)
    quiet = simulate(Plant(arm), motion, 4.0, 1000, np.random.default_rng(2))
    noisy = simulate(Plant(arm, tau_noise={"joint2": 0.3}), motion, 4.0, 1000, np.random.default_rng(2))
    np.testing.assert_array_equal(noisy["tau.joint1"], quiet["tau.joint1"])
    noise = noisy["tau.joint2"] - quiet["tau.joint2"]
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(0.3, rel=0.03)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.05
    steps = {"joint1": 1e-3, "joint2": 1e-4}
    coarse = simulate(Plant(arm, encoder_step=steps), motion, 4.0, 200, np.random.default_rng(2))
    for joint, step in steps.items():
        counts = coarse[f"q.{joint}"] / step
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    held = Plant(one_joint("revolute"), encoder_noise={"joint1": 1e-4}, servo=None)
    reading = simulate(held, rest, 4.0, 1000, np.random.default_rng(2), settle=0.0)["q.joint1"]
    assert np.sqrt(np.mean(reading**2)) == pytest.approx(1e-4, rel=0.03)


def test_the_disturbance_has_its_rms_and_band_and_goes_unmeasured():
    arm = one_joint("revolute")
    plant = Plant(arm, disturbance={"joint1": Disturbance(0.7, 1.0, 20.0)})
    recording = simulate(plant, rest, 12.0, 1000, np.random.default_rng(3))
    acceleration = motion_of(recording, arm)[2][:, 0]
    torque = (0.05 * acceleration - recording["tau.joint1"])[50:-50]
    assert np.sqrt(np.mean(torque**2)) == pytest.approx(0.7, rel=0.05)
    power, hertz = np.abs(np.fft.rfft(torque)) ** 2, np.fft.rfftfreq(len(torque), 1e-3)
    assert power[(hertz > 0.8) & (hertz < 25)].sum() > 0.85 * power.sum()


def test_the_same_seed_gives_the_same_recording_and_the_filter_keeps_the_phase(tmp_path):
    arm = random_arm(np.random.default_rng(12), 2)
    motion = fourier_motion(arm, np.random.default_rng(13), 2.0)
    plant = Plant(
        arm, friction={"joint1": LuGre(5.0)}, tau_noise={"joint1": 0.5}, disturbance={"joint2": Disturbance(0.3)}
    )
    first, again, other = (simulate(plant, motion, 2.0, 200, np.random.default_rng(s)) for s in (7, 7, 8))
    np.testing.assert_array_equal(first["tau.joint1"], again["tau.joint1"])
    assert not np.array_equal(first["tau.joint1"], other["tau.joint1"])
    smooth = simulate(Plant(arm), motion, 2.0, 200, np.random.default_rng(7), anti_alias=True)
    plain = simulate(Plant(arm), motion, 2.0, 200, np.random.default_rng(7))
    for name, values in plain.items():
        np.testing.assert_allclose(smooth[name][20:-20], values[20:-20], atol=3e-3 * np.ptp(values))
    write_csv(tmp_path / "r.csv", first)
    assert (tmp_path / "r.csv").read_text().startswith("time,q.joint1,tau.joint1,q.joint2,tau.joint2\n0,")
    np.testing.assert_allclose(
        np.loadtxt(tmp_path / "r.csv", delimiter=",", skiprows=1)[:, 2], first["tau.joint1"], rtol=1e-8, atol=1e-12
    )


def test_what_would_be_ignored_is_refused():
    arm = random_arm(np.random.default_rng(0), 2)
    with pytest.raises(ValueError, match="joint3"):
        Plant(arm, tau_delay={"joint3": 0.1})
    with pytest.raises(ValueError, match="armature"):
        Plant(arm, elasticity={"joint1": Elasticity(1e4)})
    with pytest.raises(ValueError, match="too short"):
        point_to_point_motion(arm, np.random.default_rng(0), 1.0)


def test_the_bundled_recording_is_what_its_generator_makes():
    folder = Path(__file__).resolve().parents[2] / "studies" / "bundled"
    spec = importlib.util.spec_from_file_location("bundled_generate", folder / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    generate = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(generate)
    assert (folder / "arm3.urdf").read_text() == generate.arm3().urdf("arm3")
    assert json.loads((folder / "answer.json").read_text()) == generate.ANSWER
    fresh = generate.record("holdout")
    with (folder / "holdout.csv").open() as file:
        names, stored = file.readline().strip().split(","), np.loadtxt(file, delimiter=",")
    assert names == list(fresh)
    # Another processor rounds an exponential otherwise, and some day a reading near an edge falls to the other side.
    tick, alike = 2 * np.pi / 2**20, len(stored) // 4
    for name, values in zip(names, stored.T, strict=True):
        close = 1e-3 if name.startswith("tau") else 1e-6
        np.testing.assert_allclose(fresh[name][:alike], values[:alike], rtol=1e-8, atol=close)
        if name.startswith("q"):
            np.testing.assert_allclose(fresh[name], values, rtol=1e-8, atol=1.001 * tick)
    assert sum(path.stat().st_size for path in folder.iterdir() if path.is_file()) < 2e6
