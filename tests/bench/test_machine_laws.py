"""Laws of the machines' bench, and MuJoCo's arm with them, against closed forms and conservation of energy."""

# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bench.arm import Arm, Link, random_arm
from bench.lugre import LuGre
from bench.machine_laws import Grease, froehlich, froehlich_asked, gear_loss, slots, tanh_asked, tanh_motor
from bench.machine_parts import Gear, Heating, Iron, Law, Push, Queue
from bench.mujoco_plant import Plant, simulate
from bench.parts import Bumper, Tie

MASS, GRAVITY = 5.0, 9.81
WEIGHT = MASS * GRAVITY


def lift(axis=2):
    """One slide: up for axis 2, level for axis 0."""
    return Arm((Link("prismatic", np.zeros(3), np.zeros(3), np.eye(3)[axis], MASS, np.zeros(3), np.eye(3), 2.0, 2.0),))


def steady(speed, rise=0.3):
    """From rest to a constant speed."""

    def motion(time):
        s = np.clip(time / rise, 0.0, 1.0)
        q = speed * (rise * (s**3 - s**4 / 2.0) + np.maximum(time - rise, 0.0))
        return q[:, None], speed * (3 * s**2 - 2 * s**3)[:, None], speed * (6 * (s - s**2) / rise)[:, None]

    return motion


def run(plant, speed, seconds=1.5):
    return simulate(plant, steady(speed), seconds, 200.0, np.random.default_rng(1))


@pytest.mark.parametrize(("speed", "factor"), [(0.3, 1.2), (-0.3, 0.95)])
def test_a_gear_takes_its_share_of_the_load_by_the_side_of_power(speed, factor):
    """Up the drive needs a fifth more than the weight, down the gear holds a twentieth of it."""
    recording = run(Plant(lift(), mechanisms=(Gear("joint1", 0.2, 0.05, 0.1),)), speed)
    assert recording["tau.joint1"][-50:] == pytest.approx(factor * WEIGHT, rel=1e-3)


def test_a_gear_never_gives_power_and_is_smooth_at_rest():
    load, qd = np.meshgrid(np.linspace(-9, 9, 61), np.linspace(-2, 2, 61))
    lost = gear_loss(load, qd, 0.3, 0.1, 0.5) * qd
    assert lost.min() >= 0.0
    assert np.abs(gear_loss(5.0, np.array([-1e-6, 0.0, 1e-6]), 0.3, 0.1, 0.5)).max() < 1e-4


@pytest.mark.parametrize(("law", "inverse"), [(froehlich, froehlich_asked), (tanh_motor, tanh_asked)])
def test_a_motor_that_saturates_is_asked_for_more_than_the_weight(law, inverse):
    """At small current both are the constant itself."""
    knee = 2.5 * WEIGHT
    recording = run(Plant(lift(), motor={"joint1": Iron(lambda asked: float(law(asked, knee)))}), 0.3)
    told = recording["tau.joint1"][-50:]
    assert told.min() > 1.05 * WEIGHT
    assert law(told, knee) == pytest.approx(WEIGHT, rel=1e-3)
    x = np.linspace(-0.9, 0.9, 7)
    np.testing.assert_allclose(law(inverse(x, 1.0), 1.0), x, atol=1e-12)
    assert float(law(1e-6, 1.0)) == pytest.approx(1e-6, rel=1e-5)


def test_friction_falls_as_its_own_power_warms_the_grease():
    """Against an integration of the heat balance at the speed that is held."""
    grease, level, viscous, speed = Grease(2.0, 3.0, 0.6, 10.0), 6.0, 4.0, 1.0
    part = Heating("joint1", grease)
    plant = Plant(lift(0), friction={"joint1": LuGre(level=level, viscous=viscous)}, mechanisms=(part,))
    recording = run(plant, speed, 6.0)
    cold = level + viscous * speed
    moving = solve_ivp(
        lambda t, x: cold * (1.0 - 0.6 * (1.0 - np.exp(-x / 10.0))) * steady(speed)(np.atleast_1d(t))[1][0] / 2.0
        - x / 3.0,
        (0.0, 6.0), [0.0], rtol=1e-8, t_eval=[2.0, 6.0], max_step=0.02,
    ).y[0]  # fmt: skip
    at = [np.searchsorted(recording["time"], t) for t in (2.0, 6.0)]
    assert np.array(part.theta)[[12000, 28000]] == pytest.approx(moving, rel=0.02)
    expected = cold * (0.4 + 0.6 * np.exp(-moving / 10.0))
    assert recording["tau.joint1"][at] == pytest.approx(expected, rel=0.02)


def test_a_tie_pulls_as_its_energy_falls_and_its_inertia_is_along_its_length():
    arm = random_arm(np.random.default_rng(3), 3)
    spring = {"stiffness": 7.0, "cubic": 3.0, "rest": 0.2}
    tie = Tie("joint1", "joint2", -1.0, viscous=2.0, armature=0.8, **spring)
    q, qd, qdd = np.random.default_rng(4).normal(size=(3, 3))

    def torque(plant):
        model = plant.model(2.5e-4)
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
        mujoco.mj_inverse(model, data)
        return data.qfrc_inverse.copy()

    def energy(q):
        x = q[0] - q[1] - 0.2
        return 3.5 * x**2 + 0.75 * x**4

    slope = np.array([energy(q + 1e-6 * d) - energy(q - 1e-6 * d) for d in np.eye(3)]) / 2e-6
    along = np.array([1.0, -1.0, 0.0])
    expected = slope + along * (2.0 * along @ qd + 0.8 * along @ qdd)
    np.testing.assert_allclose(torque(Plant(arm, ties=(tie,))) - torque(Plant(arm)), expected, atol=1e-6)


def test_dry_friction_of_a_tie_is_its_level():
    arm = random_arm(np.random.default_rng(3), 2)
    weightless = Plant(arm, gravity=(0.0, 0.0, 0.0), ties=(Tie("joint1", "joint2", 1.0, level=3.0),))

    def turn(time):
        q, qd, qdd = steady(0.3)(time)
        still = np.zeros_like(q)
        return np.hstack([still, q]), np.hstack([still, qd]), np.hstack([still, qdd])

    plain = Plant(arm, gravity=(0.0, 0.0, 0.0))
    told, free = (simulate(p, turn, 1.5, 200.0, np.random.default_rng(1)) for p in (weightless, plain))
    for joint in arm.joints:
        assert (told[f"tau.{joint}"] - free[f"tau.{joint}"])[-50:] == pytest.approx(3.0, abs=0.1)


def test_a_soft_end_pushes_by_how_far_it_is_pressed():
    """A slide that creeps against it."""
    arm = lift(0)
    stop = Bumper("joint1", 0.1, 80.0, 1.0, 1.0 / MASS)
    recording = run(Plant(arm, ties=(stop,)), 0.2)
    pressed = np.maximum(recording["q.joint1"] - 0.1, 0.0)
    assert recording["tau.joint1"][-50:] == pytest.approx((80.0 * pressed + 0.2)[-50:], rel=0.02)
    before = (recording["q.joint1"] < 0.09) & (recording["time"] > 0.4)
    assert before.any()
    assert np.abs(recording["tau.joint1"][before]).max() < 0.1


def test_slots_repeat_have_no_mean_and_are_no_sine():
    pitch = 0.3
    q = np.linspace(0.0, pitch, 20001)
    for rise in (0.2, 0.5):
        shape = slots(q, pitch, rise)
        np.testing.assert_allclose(slots(q + 7 * pitch, pitch, rise), shape, atol=1e-9)
        assert np.ptp(shape) == pytest.approx(2.0)
        assert np.trapezoid(shape, q) == pytest.approx(0.0, abs=1e-6)
        waves = np.abs(np.fft.rfft(shape[:-1]))
        assert waves[2] + waves[3] > 0.05 * waves[1]


def test_a_queue_gives_what_was_asked_for_steps_ago():
    give = Queue(3)()
    assert [give(float(x)) for x in range(6)] == [0.0, 0.0, 0.0, 0.0, 1.0, 2.0]
    at_once = Queue(0)()
    assert [at_once(float(x)) for x in range(3)] == [0.0, 1.0, 2.0]


def test_a_law_and_a_push_add_to_the_drive():
    """Both at a slide that the servo holds still: the drive bears their sum."""
    plant = Plant(lift(0), mechanisms=(Law("joint1", lambda q, qd: 4.0 + q), Push(np.full((2501, 1), -1.5))))
    assert run(plant, 0.0)["tau.joint1"][-20:] == pytest.approx(-2.5, abs=0.05)


def test_a_run_that_becomes_unstable_is_refused():
    """A negative damping that no step can follow; MuJoCo would set the arm back to its first pose."""
    law = Law("joint1", lambda q, qd: 1e6 * (1.0 + qd))
    with pytest.raises(ValueError, match="unstable"):
        run(Plant(lift(0), mechanisms=(law, Push(np.zeros((2501, 1))))), 0.1)
