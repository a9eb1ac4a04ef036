"""Motion of a floating arm: against Drake, closed forms of friction, conservation, order of the steps, bad input."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snarelab.errors import InputError
from snarelab.models.dormand_prince import DormandPrince, StepFault
from snarelab.models.effects import effects, get_effect
from snarelab.models.floating.arm import FloatingArm
from snarelab.models.floating.dynamics import generalized_inertia, kinetic_energy, world_momentum
from snarelab.models.floating.ets_vii import ets_vii
from snarelab.models.floating.joint_drive import Drive
from snarelab.models.floating.motion import FloatingMotion
from snarelab.models.floating.plant import FloatingPlant
from snarelab.models.inertia import from_central
from snarelab.models.model import PlacedEffect
from snarelab.models.tree import Joint, Link, Tree

TARGET = np.arange(1, 7) / 10
INERTIA = 0.8  # kg·m², of the flywheel
pytestmark = pytest.mark.usefixtures("own_cache")


@pytest.fixture(scope="module")
def gains():
    return np.diag(generalized_inertia(ets_vii(), np.zeros((1, 6)))[0])


def flywheel(speed=2.0) -> FloatingArm:
    """One joint about z on a fixed base."""
    axis = np.array([0.0, 0.0, 1.0])
    joint = Joint("wheel", "revolute", axis, -1, np.eye(3), np.zeros(3), speed=speed)
    phi = from_central(INERTIA, np.zeros(3), np.diag([INERTIA, INERTIA, INERTIA]))
    return FloatingArm(Tree("wheel", (joint,), (Link("disc", phi),), np.zeros(3)), np.zeros(10), 0, floating=False)


def wheel(effect: str, values: dict[str, float], stiffness: float = 0.0, speed: float = 2.0) -> FloatingMotion:
    """The flywheel with one effect and a servo."""
    given = {f"{effect}.wheel.{name}": value for name, value in values.items()}
    return FloatingMotion(
        flywheel(speed), Drive([stiffness], [0.0], [PlacedEffect(get_effect(effect), "wheel")], given)
    )


def test_published_run_is_drakes(gains):
    """Two formulations and two programs; at 1e-12 what is left is Drake's rounding over 25 s."""
    run = FloatingPlant(ets_vii(), gains, 2 * gains, accuracy=1e-12).run(TARGET, 10.0)
    motion = FloatingMotion(ets_vii(), Drive(gains, 2 * gains), tolerance=1e-12)
    end = motion.advance(0.0, motion.start(), 10.0, inputs=np.concatenate([np.zeros(6), TARGET])).state
    seen, (q, qd) = motion.observe(end), motion.joints(end[None])
    np.testing.assert_allclose(q[0], run.q[-1], atol=1e-10)
    np.testing.assert_allclose(qd[0], run.qd[-1], atol=1e-10)
    np.testing.assert_allclose(seen.base_position[0], run.position[-1], atol=1e-10)
    np.testing.assert_allclose(seen.base_quaternion[0], run.quaternion[-1], atol=1e-10)
    np.testing.assert_allclose(seen.base_twist[0, 3:], run.spin[-1], atol=1e-11)


def test_fixed_base_with_gravity_is_drakes(gains):
    arm = ets_vii()
    heavy = Tree(arm.tree.name, arm.tree.joints, arm.tree.links, np.array([0.3, -0.5, -1.6]))
    arm = FloatingArm(heavy, arm.base, 5, tip_translation=arm.tip_translation, floating=False, as_published=True)
    run = FloatingPlant(arm, gains, 2 * gains, accuracy=1e-12).run(TARGET, 5.0)
    motion = FloatingMotion(arm, Drive(gains, 2 * gains), tolerance=1e-12)
    end = motion.advance(0.0, motion.start(), 5.0, inputs=np.concatenate([np.zeros(6), TARGET])).state
    np.testing.assert_allclose(motion.joints(end[None])[0][0], run.q[-1], atol=1e-10)


def test_momentum_and_energy_are_kept_without_forces():
    """Tumbling with all joints free; momentum to rounding whatever the tolerance, energy as the tolerance allows."""
    rng = np.random.default_rng(5)
    motion = FloatingMotion(ets_vii(), tolerance=1e-10)
    momentum = np.concatenate([rng.normal(size=3) * 100, rng.normal(size=3) * 300])
    turned = rng.normal(size=4)
    start = motion.start(rng.normal(size=6), 0.1 * rng.normal(size=6), [1, 2, 3], turned, momentum)
    log = motion.advance(0.0, start, 20.0, log=True).log
    seen, (q, qd) = motion.observe(log[:, 1:]), motion.joints(log[:, 1:])
    back = Rotation.from_quat(seen.base_quaternion, scalar_first=True).inv()
    twist = np.hstack([back.apply(seen.base_twist[:, :3]), back.apply(seen.base_twist[:, 3:])])
    found = world_momentum(motion.arm, seen.base_position, seen.base_quaternion, q, twist, qd)
    np.testing.assert_allclose(found, np.tile(momentum, (len(log), 1)), rtol=0, atol=1e-12 * np.abs(momentum).max())
    np.testing.assert_allclose(kinetic_energy(motion.arm, q, twist, qd), seen.energy, rtol=1e-12)
    assert np.ptp(seen.energy) < 1e-7 * seen.energy.mean()
    assert np.ptp(q, axis=0).min() > 0.1  # it did move


def test_a_wrench_on_the_tip_gives_its_impulse_and_its_work(gains):
    """Impulse and moment of impulse in the world; energy is the work of a wrench that grows with time."""
    motion = FloatingMotion(ets_vii(), tolerance=1e-11)
    wrench, slope = np.array([3.0, -2.0, 4.0, 0.5, 1.0, -0.7]), np.array([0.0, 1.0, -1.0, 0.2, 0.0, 0.1])
    inputs, rates = np.zeros(12), np.zeros((2, 12))
    inputs[:6], rates[0, :6] = wrench, slope
    start = motion.start(TARGET)
    log = motion.advance(0.0, start, 4.0, inputs=inputs, rates=rates, servo=False, longest=2e-3, log=True).log
    time, seen = np.append(0.0, log[:, 0]), motion.observe(np.vstack([start, log[:, 1:]]))
    acting = wrench + time[:, None] * slope
    np.testing.assert_allclose(seen.momentum[-1, :3], 4 * wrench[:3] + 8 * slope[:3], atol=1e-10)
    moment = np.cross(seen.tip_position, acting[:, :3]) + acting[:, 3:]
    # trapezes of 2 ms: error h²/12 times the change of the integrand's slope, 1e-6 of the whole
    np.testing.assert_allclose(seen.momentum[-1, 3:], np.trapezoid(moment, time, axis=0), atol=1e-4)
    power = np.einsum("ni,ni->n", acting, seen.tip_twist)
    assert seen.energy[-1] == pytest.approx(np.trapezoid(power, time), rel=1e-5)


def test_steps_are_of_fifth_order():
    """Global error of steps of one length, on a nonlinear pendulum; each halving divides it by about 32."""
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("u")
    steps = DormandPrince(ca.Function("f", [t, x, u], [ca.vertcat(x[1], -ca.sin(x[0]) + u * ca.cos(t))]), np.ones(2), 1)
    exact = DormandPrince(
        ca.Function("f", [t, x, u], [ca.vertcat(x[1], -ca.sin(x[0]) + u * ca.cos(t))]), np.ones(2), 1e-14
    )
    start, u1 = np.array([1.0, 0.0]), np.array([0.3])
    truth = exact.advance(0.0, start, 4.0, u1, 1e-3).state
    error = []
    for size in (0.1, 0.05, 0.025):
        end = steps.advance(0.0, start, 4.0, u1, size, longest=size)
        error.append(np.abs(end.state - truth).max())
        assert end.time == 4.0
        assert end.tried == round(4 / size)
    assert np.log2(error[0] / error[1]) == pytest.approx(5, abs=0.35)
    assert np.log2(error[1] / error[2]) == pytest.approx(5, abs=0.35)


def test_a_step_that_cannot_be_taken_is_a_fault():
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x"), ca.SX.sym("u")
    blows = DormandPrince(ca.Function("f", [t, x, u], [x**2]), np.ones(1))
    with pytest.raises(StepFault, match=r"no step is short enough at (1|0\.99)"):
        blows.advance(0.0, np.ones(1), 2.0, np.zeros(1), 0.1)
    stiff = DormandPrince(ca.Function("f", [t, x, u], [-1e9 * x]), np.ones(1))
    with pytest.raises(StepFault, match="1000 steps reached only"):
        stiff.advance(0.0, np.ones(1), 1.0, np.zeros(1), 0.1, limit=1000)


def test_coulomb_friction_stops_a_wheel_and_holds_it():
    """Constant deceleration to the stop; then it stays. The law's sign is smooth over 6e-4 rad/s."""
    motion = wheel("coulomb_friction", {"level": 0.4})
    stop = 1.0 * INERTIA / 0.4
    half = motion.advance(0.0, motion.start(qd=[1.0]), stop / 2).state
    q, qd = motion.joints(half[None])
    np.testing.assert_allclose([q[0, 0], qd[0, 0]], [0.75 * stop / 2, 0.5], atol=1e-8)
    end = motion.advance(stop / 2, half, 3 * stop).state
    q, qd = motion.joints(end[None])
    assert q[0, 0] == pytest.approx(stop / 2, abs=1e-3)
    assert abs(qd[0, 0]) < 1e-8


def test_load_dependent_friction_takes_its_share():
    """The link gets load = motor / (1 + c): friction that grows with the load that it leaves over."""
    motion = wheel("load_dependent_friction", {"coefficient": 0.25}, 1e-9)
    target = np.array([0.0] * 6 + [3e9])  # a torque of 3 N·m whatever the position
    state = motion.advance(0.0, motion.start(qd=[0.5]), 0.1, inputs=target).state
    assert motion.joints(state[None])[1][0, 0] == pytest.approx(0.5 + 0.1 * 3 / 1.25 / INERTIA, rel=1e-8)


def test_rotor_inertia_slows_the_joint():
    motion = wheel("rotor_inertia", {"inertia": 1.7}, 1e-9)
    target = np.array([0.0] * 6 + [3e9])
    state = motion.advance(0.0, motion.start(), 0.5, inputs=target).state
    assert motion.joints(state[None])[1][0, 0] == pytest.approx(0.5 * 3 / (INERTIA + 1.7), rel=1e-9)


def test_hidden_states_move_with_the_joint():
    """A Dahl bristle and Coulomb friction of one level: a spring of stiffness level / travel for small strokes."""
    placed = [PlacedEffect(get_effect(name), "wheel") for name in ("coulomb_friction", "presliding_hysteresis")]
    values = {
        "coulomb_friction.wheel.level": 2.0,
        "presliding_hysteresis.wheel.level": 2.0,
        "presliding_hysteresis.wheel.travel": 0.01,
    }
    motion = FloatingMotion(flywheel(), Drive(effects=placed, values=values))
    speed = 1e-5  # the stroke is then 1/160 of the travel
    log = motion.advance(0.0, motion.start(qd=[speed]), 1.0, longest=0.01, log=True).log
    period = 2 * np.pi * np.sqrt(INERTIA * 0.01 / 2.0)
    q = motion.joints(log[:, 1:])[0][:, 0]
    first = log[np.flatnonzero(np.diff(np.sign(q)))[0], 0]
    assert first == pytest.approx(period / 2, rel=0.02)


def test_every_joint_torque_of_the_registry_runs():
    """Any registered joint friction can act, with its usual parameters; one that dissipates never adds energy."""
    for name, effect in effects().items():
        if effect.at != "joint" or effect.acts_on != "torque" or effect.neighbours == "only":
            continue
        values = {p.name: 0.1 for p in effect.parameters if p.low == 0.0 and not p.grid}
        if name == "heating_friction":
            with pytest.raises(InputError, match="reads 'temperature', which a simulated joint does not have"):
                wheel(name, values)
            continue
        motion = wheel(name, values)
        end = motion.advance(0.0, motion.start(q=[0.1], qd=[1.0]), 0.2).state
        qd = motion.joints(end[None])[1][0, 0]
        assert np.isfinite(qd), name
        if effect.dissipates:
            assert 0.0 <= qd <= 1.0, name


@pytest.mark.usefixtures("compiler")
def test_bad_drives_are_named(gains):
    arm = flywheel()
    with pytest.raises(InputError, match=r"stiffness is \[1.0, 2.0\]; give 1 finite numbers >= 0"):
        FloatingMotion(arm, Drive([1.0, 2.0], [1.0]))
    with pytest.raises(InputError, match="coulomb_friction at 'elbow'; this arm has wheel"):
        FloatingMotion(arm, Drive(effects=[PlacedEffect(get_effect("coulomb_friction"), "elbow")]))
    with pytest.raises(InputError, match="joint_elasticity is no torque at a joint"):
        FloatingMotion(arm, Drive(effects=[PlacedEffect(get_effect("joint_elasticity"), "wheel")]))
    with pytest.raises(InputError, match="needs the speed limit of 'wheel', which is inf"):
        wheel("coulomb_friction", {"level": 1.0}, speed=np.inf)
    with pytest.raises(InputError, match=r"coulomb_friction.wheel.level is -1; allowed is 0 to inf"):
        wheel("coulomb_friction", {"level": -1.0})
    with pytest.raises(InputError, match=r"no parameter 'coulomb_friction.wheel.lvel' \(nearest: .*level\)"):
        wheel("coulomb_friction", {"lvel": 1.0})
    with pytest.raises(InputError, match=r"qd is \[1.0, 2.0\]; give 1 finite numbers"):
        FloatingMotion(arm).start(qd=[1.0, 2.0])
    floating = FloatingMotion(ets_vii())
    with pytest.raises(InputError, match="give position, quaternion, momentum"):
        floating.start(position=[np.nan, 0, 0])
    with pytest.raises(InputError, match="quaternion is zero"):
        floating.start(quaternion=np.zeros(4))
    with pytest.raises(InputError, match="6 inputs given; give 12"):
        floating.advance(0.0, floating.start(), 1.0, inputs=TARGET)
