"""The second proof's plant against closed forms, conservation and Pinocchio's algorithms; its disturbances."""

# pyright: reportAttributeAccessIssue=false
import numpy as np
import pinocchio as pin
import pytest
from scipy.signal import welch
from scipy.special import ellipk

from proof.drives.bodies import Bodies, inertias_along, torques
from proof.drives.laws import DAHL, LAGGING, SLIP, Friction, Laws
from proof.drives.loop import STEPS, TICK, Drives, run, spring
from proof.drives.motions import COLOURED, KINDS, WANDERING, WHITE, disturbance, motion

MASS, LENGTH, GRAVITY = 2.0, 0.5, 9.81
OWN = 0.03  # kg·m² about the centre


def chain(n, axes=(0.0, 1.0, 0.0)):
    """A chain of equal bodies that hang a distance apart, all axes alike."""
    model, parent = pin.Model(), 0
    for k in range(n):
        place = pin.SE3(np.eye(3), np.array([LENGTH if k else 0.0, 0.0, 0.0]))
        parent = model.addJoint(parent, pin.JointModelRevoluteUnaligned(*axes), place, f"joint{k + 1}")
        model.appendBodyToJoint(
            parent, pin.Inertia(MASS, np.array([LENGTH, 0.0, 0.0]), OWN * np.eye(3)), pin.SE3.Identity()
        )
    return Bodies.of(model)


def friction(n, level=0.0, viscous=0.0, kind=DAHL, travel=1e-3):
    return Friction(np.full(n, kind), *(np.full(n, x) for x in (level, viscous, travel, 0.1)))


def drives(n, rotor=0.0, kp=0.0, kd=0.0, sprung=(0.0, 0.0, 0.0), limit=1e9, lag=1e-3):
    motor = np.arange(n)
    if sprung[0]:
        motor[-1] = n
    full = np.ones(n)
    stiffness, damping, gap = (x * full for x in sprung)
    count = 1e-9 * full
    return Drives(
        motor, rotor * full, stiffness, damping, gap, lag * full, limit * full, kp * full, kd * full, count, full
    )


def no_laws():
    empty = np.zeros(0, dtype=np.int64)
    return Laws(empty, empty, empty, np.zeros(0), np.zeros((0, 6)), np.zeros((0, 256)))


def simulated(bodies, own, rubbing, q, qd=None, free=False, feedforward=None, seconds=None):
    """Every tick's truth; ``q`` is the asked motion (n_ticks, n), or the start of a free one."""
    if seconds is not None:
        q = np.tile(np.atleast_2d(q), (round(seconds / TICK), 1))
    qd = np.zeros_like(q) if qd is None else qd
    zero = np.zeros_like(q)
    fed = zero if feedforward is None else feedforward
    return run(bodies, own, rubbing, no_laws(), np.stack([q, qd], axis=1), fed, zero, 0.0, free)


def test_bodies_are_pinocchios():
    rng, model, parent = np.random.default_rng(0), pin.Model(), 0
    for k in range(6):
        axis = rng.normal(size=3)
        turning = pin.JointModelRevoluteUnaligned(*(axis / np.linalg.norm(axis)))
        rotation = pin.rpy.rpyToMatrix(*rng.uniform(-3, 3, 3))
        parent = model.addJoint(parent, turning, pin.SE3(rotation, rng.normal(size=3)), f"joint{k}")
        box = pin.Inertia.FromBox(float(rng.uniform(1, 9)), *rng.uniform(0.1, 1.0, 3))
        model.appendBodyToJoint(parent, box, pin.SE3(rotation.T, rng.normal(size=3)))
    bodies, data = Bodies.of(model), model.createData()
    q, qd, qdd = rng.normal(size=(3, 8, 6))
    expected = np.array([pin.rnea(model, data, *x) for x in zip(q, qd, qdd, strict=True)])
    np.testing.assert_allclose(torques(bodies, q, qd, qdd), expected, rtol=1e-11, atol=1e-10)
    for found, at in zip(inertias_along(bodies, q), q, strict=True):
        upper = np.triu(pin.crba(model, data, at))
        np.testing.assert_allclose(found, upper + np.triu(upper, 1).T, rtol=1e-11, atol=1e-10)


@pytest.mark.parametrize("swing", [0.05, 1.5])
def test_pendulum_swings_with_its_period(swing):
    """4 sqrt(I / (m g l)) K(sin²(swing / 2)): exact at any amplitude."""
    period = 4.0 * np.sqrt((OWN + MASS * LENGTH**2) / (MASS * GRAVITY * LENGTH)) * ellipk(np.sin(swing / 2.0) ** 2)
    # The body lies along x; about +y, a quarter turn lets it hang.
    start = np.array([np.pi / 2.0 + swing])
    true = simulated(chain(1), drives(1), friction(1), start, free=True, seconds=6.0 * period)
    angle = true[:, 0, 0] - np.pi / 2.0
    down = np.flatnonzero((angle[:-1] > 0.0) & (angle[1:] <= 0.0))
    times = down + angle[down] / (angle[down] - angle[down + 1])
    np.testing.assert_allclose(np.diff(times) * TICK, period, rtol=2e-6)


def test_energy_of_a_free_double_pendulum_stays():
    bodies = chain(2)
    true = simulated(bodies, drives(2), friction(2), np.array([0.3, 1.0]), free=True, seconds=10.0)
    q, qd = true[:, 0], true[:, 1]
    matrices = inertias_along(bodies, q.copy())
    kinetic = 0.5 * np.einsum("ki,kij,kj->k", qd, matrices, qd)
    # Heights of both centres: about +y, x turns to -z.
    first = -np.sin(q[:, 0])
    second = first - np.sin(q[:, 0] + q[:, 1])
    energy = kinetic + MASS * GRAVITY * LENGTH * (first + second)
    assert np.ptp(kinetic) > 10.0
    assert np.abs(energy - energy[0]).max() < 2e-5 * np.ptp(kinetic)


@pytest.mark.parametrize("kind", [DAHL, SLIP, LAGGING])
def test_friction_at_steady_speed_is_level_and_slope(kind):
    """About an upright axis gravity does nothing: the motor gives friction alone."""
    speed, ticks = 0.7, 3000
    asked = np.column_stack([speed * TICK * np.arange(ticks)])
    own = drives(1, kp=400.0, kd=60.0)
    true = simulated(chain(1, (0.0, 0.0, 1.0)), own, friction(1, 3.0, 2.0, kind), asked, np.full_like(asked, speed))
    np.testing.assert_allclose(true[-500:, 3, 0], 3.0 + 2.0 * speed, rtol=1e-4)


@pytest.mark.parametrize("kind", [DAHL, SLIP, LAGGING])
def test_what_pushes_less_than_the_level_moves_nothing_far(kind):
    fed = np.full((2000, 1), 2.0)
    rubbing = friction(1, 3.0, 20.0, kind, travel=2e-3)  # bristles alone would ring
    true = simulated(chain(1, (0.0, 0.0, 1.0)), drives(1), rubbing, np.zeros((2000, 1)), feedforward=fed)
    assert 1e-4 < np.abs(true[:, 0, 0]).max() < 0.02
    assert np.abs(true[-200:, 1, 0]).max() < 1e-3
    assert true[-1, 4, 0] == pytest.approx(2.0, rel=0.01)


def test_link_swings_on_its_spring():
    """A motor too heavy to move: the link's frequency is sqrt(K / I) about where the spring carries it."""
    stiffness, inertia = 4000.0, OWN + MASS * LENGTH**2
    own = drives(1, rotor=1e9, sprung=(stiffness, 0.0, 0.0))
    true = simulated(chain(1), own, friction(1), np.zeros(1), free=True, seconds=2.0)
    sag = MASS * GRAVITY * LENGTH / stiffness
    assert np.ptp(true[:, 6, 0]) == pytest.approx(2.0 * sag, rel=1e-3)
    lift = true[:, 6, 0] - sag
    down = np.flatnonzero((lift[:-1] < 0.0) & (lift[1:] >= 0.0))
    frequency = 1.0 / (np.mean(np.diff(down)) * TICK)
    assert frequency == pytest.approx(np.sqrt(stiffness / inertia) / (2.0 * np.pi), rel=2e-3)
    assert np.ptp(true[:, 0, 0]) < 1e-6


def test_play_hands_nothing_over():
    own = drives(1, sprung=(100.0, 2.0, 0.02))
    assert spring(own, 0, 0.009, 0.0) == 0.0
    assert spring(own, 0, 0.03, 0.0) == pytest.approx(2.0)
    assert spring(own, 0, -0.03, 0.5) == pytest.approx(-2.0 + 1.0)


def test_torque_ends_at_the_limit_and_lags_the_command():
    fed = np.full((400, 1), 50.0)
    fed[0] = 0.0
    true = simulated(
        chain(1, (0.0, 0.0, 1.0)), drives(1, limit=20.0, lag=0.02), friction(1), np.zeros((400, 1)), feedforward=fed
    )
    # The command of tick 1 is the limit; a time constant later all but 1/e of it flows.
    assert true[21, 3, 0] == pytest.approx(20.0 * (1.0 - np.exp(-1.0)), rel=1e-6)
    assert true[:, 3, 0].max() <= 20.0
    assert STEPS * (TICK / STEPS) == TICK


def test_motions_start_and_end_at_rest_within_their_limits():
    travel, speed = np.array([0.7, 1.2]), np.array([1.0, 2.0])
    for seed in range(6):
        q, qd, qdd = motion(np.random.default_rng(seed), 12.0, travel, speed)
        assert len(q) == 13_001
        assert np.all(np.abs(q).max(axis=0) <= travel)
        assert np.all(np.abs(qd).max(axis=0) <= speed)
        assert np.all(np.abs(q).max(axis=0) > 0.2 * travel)
        np.testing.assert_allclose([q[0], q[-1], qd[0], qd[-1]], 0.0, atol=1e-3)
        assert np.all(np.isfinite(qdd))


SCALES = {WHITE: 25.0, COLOURED: 0.2, WANDERING: 5.0}


@pytest.mark.parametrize("kind", KINDS)
def test_disturbance_has_its_size(kind):
    made = disturbance(np.random.default_rng(3), kind, SCALES[kind], 200_000, 3)
    np.testing.assert_allclose(np.sqrt(np.mean(made**2, axis=0)), 1.0, rtol=0.1)
    assert np.abs(np.corrcoef(made.T)[np.triu_indices(3, 1)]).max() < 0.4


def test_white_is_flat_up_to_its_edge_and_coloured_forgets():
    white = disturbance(np.random.default_rng(1), WHITE, 25.0, 400_000, 1)[:, 0]
    frequency, power = welch(white, 1.0 / TICK, nperseg=4000)
    inside = power[(frequency > 0.5) & (frequency < 18.0)]
    assert inside.std() / inside.mean() < 0.2
    assert power[frequency > 60.0].max() < 1e-2 * inside.mean()
    coloured = disturbance(np.random.default_rng(2), COLOURED, 0.2, 2_000_000, 1)[:, 0]
    for lag in (0.1, 0.3):
        ahead = round(lag / TICK)
        kept = np.mean(coloured[ahead:] * coloured[:-ahead]) / np.mean(coloured**2)
        assert kept == pytest.approx(np.exp(-lag / 0.2), abs=0.03)


@pytest.mark.parametrize("scale", [5.0, np.inf])
def test_wandering_is_slow_and_no_bias(scale):
    made = disturbance(np.random.default_rng(4), WANDERING, scale, 20_000, 4)
    np.testing.assert_allclose(made.mean(axis=0), 0.0, atol=1e-12)
    # In a tenth of a second it moves by sqrt(2 · 0.1 / 5) = 0.2 of its own size, drawn anew in each of four.
    steps = made[100:] - made[:-100]
    assert np.median(np.sqrt(np.mean(steps**2, axis=0))) < 0.45
