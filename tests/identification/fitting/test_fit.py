"""The joint fit: against scipy from many starts, its standard deviations against repeated noise, and its edges."""

import numpy as np
import pytest
import scipy.optimize
from evaluations import evaluations
from moving_arm import exact

from bench.arm import random_arm
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.base_parameters import base_parameters
from snarelab.identification.fitting.experiment import Experiment, scales
from snarelab.identification.fitting.fit import channel_rms, fit
from snarelab.identification.fitting.least_squares import NormalEquations, Objective
from snarelab.identification.fitting.problem import Problem, split
from snarelab.identification.fitting.projection import minimise_projected
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.rigid_body import RigidBody
from snarelab.models.urdf import load_urdf

PERIOD, N, THINNING = 5e-3, 4000, 2
JOINTS = ("joint1", "joint2")


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(random_arm(np.random.default_rng(4), 2).urdf())
    return RigidBody(load_urdf(path, (0.0, 0.0, -9.81)))


def recording(body, friction, still=()):
    """Sines on two joints, torque of the rigid body plus ``friction(qd)`` (n, 2); ``still`` joints stand."""
    t = np.asarray(PERIOD * np.arange(N), np.float64)
    q, qd, qdd = np.zeros((3, N, 2))
    for size, frequency in ((0.8, 0.11), (0.3, 0.31), (0.1, 0.73)):
        w = 2 * np.pi * frequency * np.array([1.0, 1.17])
        angle = w * t[:, None] + np.array([0.0, 1.0])
        q += size * np.sin(angle)
        qd += size * w * np.cos(angle)
        qdd -= size * w**2 * np.sin(angle)
    for joint in still:
        q[:, joint] = qd[:, joint] = qdd[:, joint] = 0.0
    tau = body.torque(q, qd, qdd) + friction(qd)
    motion = exact(JOINTS, PERIOD, THINNING, (t, q, qd, qdd, tau))
    return Experiment(motion, body)


def assembly(body, experiment, *names, base=None):
    placed = [PlacedEffect(get_effect(name), joint) for name in names for joint in JOINTS]
    return TorqueModel(body.tree, placed, base, scales([experiment]), {})


def sign(qd):
    return np.tanh(qd / (3e-4 * np.abs(qd).max(axis=0)))


def stribeck(qd, level, extra, speed, viscous):
    return (level + extra * np.exp(-((qd / speed) ** 2))) * sign(qd) + viscous * qd


def makkar(qd, p):
    return p[0] * (np.tanh(qd / p[1]) - np.tanh(qd / p[1] / p[2])) + p[3] * np.tanh(qd / p[4]) + p[5] * qd


def coloured(rng, correlation):
    """First-order noise (N, 2) of unit variance."""
    keep = np.exp(-PERIOD / correlation)
    noise, white = np.empty((N, 2)), rng.normal(size=(N, 2))
    noise[0] = white[0]
    for k in range(1, N):
        noise[k] = keep * noise[k - 1] + np.sqrt(1 - keep**2) * white[k]
    return noise


def test_the_optimum_is_the_best_that_scipy_finds_from_many_starts(body):
    """Scipy is given the friction law written out by hand."""
    rng = np.random.default_rng(0)
    noise = 0.2 * rng.normal(size=(N, 2))
    truth = np.array([[3.0, 2.0, 0.1, 1.5], [2.0, 1.5, 0.05, 0.8]])
    run = recording(body, lambda qd: stribeck(qd, *truth.T) + noise)
    model = assembly(body, run, "viscous_friction", "coulomb_friction", "stribeck_friction")
    found = fit(model, [run])
    motion = run.motion
    rigid = body.torque(motion.q, motion.qd, motion.qdd)
    for joint in range(2):

        def residual(x, j=joint):
            return motion.to_band((motion.tau - rigid)[:, j] - stribeck(motion.qd, *x)[:, j])

        top = np.abs(motion.qd[:, joint]).max()
        low, high = np.array([0.0, 0.0, 0.005 * top, 0.0]), np.array([np.inf, np.inf, top, np.inf])
        runs = [
            scipy.optimize.least_squares(
                residual, [1.0, 1.0, top * s, 1.0], bounds=(low, high), x_scale="jac", ftol=1e-13, xtol=1e-13
            )
            for s in np.geomspace(0.01, 0.5, 8)
        ]
        best = min(runs, key=lambda r: r.cost)
        assert 0.5 * found.sigma[joint] ** 2 * len(run.measured) == pytest.approx(best.cost, rel=1e-7)
        values = [
            found.theta[[s.key for s in model.slots].index(f"{name}.{JOINTS[joint]}.{what}")]
            for name, what in (
                ("coulomb_friction", "level"),
                ("stribeck_friction", "level"),
                ("stribeck_friction", "speed"),
                ("viscous_friction", "coefficient"),
            )
        ]
        np.testing.assert_allclose(values, best.x, rtol=1e-3)
        np.testing.assert_allclose(values, truth[joint], rtol=0.05)


@pytest.mark.xfail(
    strict=True,
    reason="the grid of starts has the point that it is begun from, and the last search begins where the best one "
    "ended; neither is among the three evaluations that stay with a recording",
)
@pytest.mark.parametrize("name", ["stribeck_friction", "presliding_hysteresis"])
def test_a_fit_from_many_starts_evaluates_no_model_twice_at_the_same_parameters(body, name):
    run = recording(body, lambda qd: stribeck(qd, 3.0, 2.0, 0.1, 1.5))
    model = assembly(body, run, "viscous_friction", name)
    with evaluations() as counted:
        fit(model, [run])
    assert len(counted) > 10
    assert max(counted.values()) == 1


def test_many_starts_reach_the_best_makkar_curve(body):
    """The friction curve is compared: the parameters mean little, and two of the law's terms may have swapped roles."""
    rng = np.random.default_rng(1)
    noise = 0.05 * rng.normal(size=(N, 2))
    truth = np.array([[4.0, 0.02, 12.0, 3.0, 0.05, 1.0], [2.0, 0.01, 20.0, 1.0, 0.6, 0.3]])
    run = recording(body, lambda qd: np.stack([makkar(qd[:, j], truth[j]) for j in range(2)], 1) + noise)
    model = assembly(body, run, "makkar_friction")
    found = fit(model, [run])
    assert found.starts >= found.agreed >= 1
    floor = np.sqrt(np.mean(run.motion.to_band(noise) ** 2, axis=0))
    np.testing.assert_allclose(found.sigma, floor, rtol=0.02)
    for joint in range(2):
        v = np.linspace(-1, 1, 400) * np.abs(run.motion.qd[:, joint]).max()
        wanted = makkar(v, truth[joint])
        curve = makkar(v, found.theta[6 * joint : 6 * joint + 6])
        assert np.sqrt(np.mean((curve - wanted) ** 2)) < 0.01 * np.sqrt(np.mean(wanted**2))


@pytest.mark.parametrize(
    ("steep", "fade", "extra"),
    [
        pytest.param(0.01, 0.06, 2.0, marks=pytest.mark.slow),
        (0.01, 0.12, 4.0),
        pytest.param(0.03, 0.12, 2.0, marks=pytest.mark.slow),
    ],
)
def test_the_best_makkar_curve_is_found_for_a_bump_that_is_none_of_its_own(body, steep, fade, extra):
    """A bell-shaped bump, as LuGre friction has; scipy looks for the best curve from many random starts.

    Two of the law's terms swap roles from one optimum to the next: random starts alone missed the best in half of the
    seeds.
    """

    def friction(qd):
        share = qd / np.abs(qd).max(axis=0)
        return (4.0 + extra * np.exp(-((share / fade) ** 2))) * np.tanh(share / steep) + qd

    run = recording(body, friction)
    model = assembly(body, run, "makkar_friction")
    fits = [fit(model, [run], seed=seed) for seed in range(4)]
    motion, rng = run.motion, np.random.default_rng(2)
    rigid = body.torque(motion.q, motion.qd, motion.qdd)
    for joint in range(2):
        top = np.abs(motion.qd[:, joint]).max()
        low, high = (bound[6 * joint : 6 * joint + 6] for bound in (model.low, model.high))

        def residual(x, j=joint):
            left = (motion.tau - rigid)[:, j] - makkar(motion.qd[:, j], x)
            return motion.to_band(left[:, None])[:, 0]

        costs = []
        for _ in range(12):
            shape = top * 10 ** rng.uniform(-2, -1), 10 ** rng.uniform(0.1, 1.0), top * 10 ** rng.uniform(-2, -1)
            start = [2 * extra, shape[0], shape[1], 4.0, shape[2], 1.0]
            costs.append(
                scipy.optimize.least_squares(residual, start, bounds=(low, high), x_scale="jac", max_nfev=60).cost
            )
        for found in fits:
            assert 0.5 * found.sigma[joint] ** 2 * len(run.measured) <= 1.01 * min(costs)


def test_standard_deviations_cover_the_truth_under_coloured_noise(body):
    """Noise that remembers 40 ms: deviations of the estimates over 20 recordings are what the fit says they are."""
    truth = np.array([1.5, 0.8, 3.0, 2.0])  # viscous of both joints, Coulomb of both
    normalised = []
    for seed in range(20):
        noise = 0.3 * coloured(np.random.default_rng(100 + seed), 0.04)
        run = recording(body, lambda qd, e=noise: truth[2:] * sign(qd) + truth[:2] * qd + e)
        found = fit(assembly(body, run, "viscous_friction", "coulomb_friction"), [run])
        normalised.append((found.theta - truth) / found.std)
    normalised = np.array(normalised)
    assert 0.86 <= np.mean(np.abs(normalised) < 2) <= 1.0
    assert 0.6 < np.mean(normalised**2) < 1.6


def test_a_parameter_at_its_bound_is_named_and_only_that_one(body):
    run = recording(body, lambda qd: 2.0 * sign(qd) + np.array([-0.5, 0.5]) * qd)
    model = assembly(body, run, "viscous_friction", "coulomb_friction")
    found = fit(model, [run])
    assert [s.key for s, b in zip(model.slots, found.at_bound, strict=True) if b] == [
        "viscous_friction.joint1.coefficient"
    ]
    assert found.theta[0] == 0.0


def test_what_the_data_do_not_carry_stays_and_is_said_to_be_unknown(body):
    run = recording(body, lambda qd: 2.0 * qd, still=[1])
    model = assembly(body, run, "viscous_friction", "makkar_friction")
    found = fit(model, [run], start=model.start + 0.25 * np.minimum(1.0, model.high - model.start))
    still = [k for k, s in enumerate(model.slots) if s.at == "joint2"]
    moving = [k for k, s in enumerate(model.slots) if s.key == "viscous_friction.joint1.coefficient"]
    assert np.all(np.isfinite(found.theta))
    assert np.all(np.isinf(found.std[still]))
    # The viscous coefficient of the moving joint has an exact alias in Makkar's law: only their sum is known.
    aliases = [k for k, s in enumerate(model.slots) if s.at == "joint1" and s.name.endswith("coefficient")]
    assert np.all(np.isinf(found.std[aliases]))
    assert np.any(np.isfinite(found.std))
    assert len(moving) == 1
    np.testing.assert_array_equal(found.theta[still][0], model.start[still][0] + 0.25)


def test_a_trial_that_overflows_is_refused_without_a_warning(body):
    run = recording(body, lambda qd: 2.0 * qd)
    model = assembly(body, run, "viscous_friction")
    (first, _) = split(model, [run], model.start)
    assert first.normal(np.array([1e300]), np.ones(1)).cost == np.inf
    assert np.isfinite(first.normal(np.array([1.0]), np.ones(1)).cost)


@pytest.mark.parametrize(
    ("names", "free", "parts"),
    [
        (("viscous_friction", "coulomb_friction"), False, 2),
        (("viscous_friction",), True, 1),
        (("viscous_friction", "joint_elasticity"), False, 1),
    ],
)
def test_parts_share_no_parameter_and_add_up_to_the_whole(body, names, free, parts):
    """Cost, gradient and normal matrix of the parts, put together, are those of the whole model."""
    run = recording(body, lambda qd: 2.0 * qd)
    model = assembly(body, run, *names, base=base_parameters(body) if free else None)
    rng = np.random.default_rng(3)
    theta = model.start * rng.uniform(0.8, 1.2, len(model.start)) + 0.1
    whole = Problem(model, (run,), np.arange(2), np.arange(len(theta))).normal(theta, np.array([1.0, 2.0]))
    found = split(model, [run], theta)
    assert len(found) == parts
    together = NormalEquations(0.0, np.zeros_like(whole.gradient), np.zeros_like(whole.matrix))
    cost = 0.0
    for part in found:
        one = part.normal(theta[part.index], np.array([1.0, 2.0])[part.channels])
        cost += one.cost
        together.gradient[part.index] += one.gradient
        together.matrix[np.ix_(part.index, part.index)] += one.matrix
    assert cost == pytest.approx(whole.cost, rel=1e-12)
    np.testing.assert_allclose(together.gradient, whole.gradient, rtol=1e-9, atol=1e-9 * abs(whole.gradient).max())
    np.testing.assert_allclose(together.matrix, whole.matrix, rtol=1e-9, atol=1e-9 * abs(whole.matrix).max())


def test_channel_rms_is_of_what_is_left(body):
    run = recording(body, lambda qd: 2.0 * qd)
    model = assembly(body, run, "viscous_friction")
    rms, measured = channel_rms(model, [run], np.array([2.0, 1.5]))
    assert rms[0] < 1e-9 * measured[0]
    assert rms[1] == pytest.approx(0.5 * np.sqrt(np.mean(run.motion.to_band(run.motion.qd[:, 1]) ** 2)), rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_projected_search_ends_where_scipy_does(seed):
    """Two decays, amplitudes between bounds of which one is active in half of the draws."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 4, 80)
    data = 3 * np.exp(-0.4 * t) + 2 * np.exp(-2.5 * t) + 0.02 * rng.normal(size=80)
    low, high = np.zeros(4), np.array([10.0, 1.5 if seed % 2 else 10.0, 20.0, 20.0])

    def residual(x):
        return x[0] * np.exp(-x[2] * t) + x[1] * np.exp(-x[3] * t) - data

    def normal(x):
        e, f = np.exp(-x[2] * t), np.exp(-x[3] * t)
        jacobian = np.stack([e, f, -x[0] * t * e, -x[1] * t * f], 1)
        r = residual(x)
        return NormalEquations(0.5 * float(r @ r), jacobian.T @ r, jacobian.T @ jacobian)

    start = np.array([1.0, 1.0, 0.2, 4.0])
    shapes = np.array([False, False, True, True])
    found = minimise_projected(Objective(normal, low, high), start, shapes, tolerance=1e-12)
    wanted = scipy.optimize.least_squares(
        residual, found.theta, bounds=(low - 1e-12, high + 1e-12), ftol=1e-15, xtol=1e-15, gtol=1e-15, max_nfev=2000
    )
    far = scipy.optimize.least_squares(
        residual, start, bounds=(low - 1e-12, high + 1e-12), ftol=1e-15, xtol=1e-15, gtol=1e-15, max_nfev=5000
    )
    assert found.settled
    assert found.normal.cost <= min(wanted.cost, far.cost) * (1 + 1e-8)
    assert np.all((found.theta >= low) & (found.theta <= high))


def test_a_model_with_an_effect_taken_out_keeps_the_links_that_its_file_holds(body):
    """By hand: links heavier than the URDF's, and the viscous friction that is left."""
    run = recording(body, lambda qd: 0 * qd)
    links = body.tree.links
    placed = [PlacedEffect(get_effect(name), "joint1") for name in ("viscous_friction", "coulomb_friction")]
    TorqueModel(body.tree, placed, None, scales([run]), {}).torque(
        run, np.array([3.0, 5.0])
    )  # fills what the run keeps
    values = {f"inertia.{link.name}.mass": 1.5 * link.phi[0] for link in links}
    whole = TorqueModel(body.tree, placed, None, scales([run]), values)
    kept = whole.keep(placed[:1], np.array([3.0, 5.0]))
    assert kept.start == pytest.approx([3.0])
    wanted = run.regressor.dense() @ np.concatenate([[1.5 * link.phi[0], *link.phi[1:]] for link in links])
    wanted[:, 0] += 3.0 * run.motion.qd[:, 0]
    np.testing.assert_allclose(kept.torque(run, np.array([3.0])), wanted, rtol=1e-12, atol=1e-12)
