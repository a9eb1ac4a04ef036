"""Nameless curves: the basis against the kernel it stands for, and what each of the family runs over."""

import numpy as np
import pytest
from moving_arm import build, motion, placed, three_joints

from snarelab.identification.fitting.experiment import Experiment
from snarelab.identification.nuisance.curve import BEYOND, SMALL, Coordinates, basis, family


@pytest.mark.parametrize(("length", "order"), [(0.25, 8), (0.07, 24), (0.03, 52), (0.2, 8)])
def test_a_curve_has_unit_variance_and_the_kernel_of_its_length(length, order):
    """Squared exponential: a correlation of exp(-d²/2l²), d in shares of the range. The sines vanish beyond the range,
    and so have their unit variance on average over more than it."""
    low, high = -1.3, 2.1
    u = np.linspace(0.1, 0.9, 81)
    x = basis(low + u * (high - low), low, high, length, order)
    assert x.shape == (81, order)
    kernel = x @ x.T
    deviation = np.sqrt(np.diag(kernel))
    wanted = np.exp(-0.5 * ((u[:, None] - u) / length) ** 2)
    assert np.abs(kernel / np.outer(deviation, deviation) - wanted).max() < 0.12
    assert deviation == pytest.approx(1.0, abs=0.17)


def test_beyond_its_range_a_curve_stays_finite_and_ends():
    x = basis(np.array([-5.0, 0.0, 1.0, 7.0, 70.0]), 0.0, 1.0, 0.25, 8)
    assert np.abs(x).max() < 2
    np.testing.assert_array_equal(x[3], x[4])
    assert BEYOND > 1.2  # it is held there inside its own half-width


def test_a_coordinate_that_does_not_change_is_no_division_by_zero():
    assert np.isfinite(basis(np.ones(4), 1.0, 1.0, 0.25, 8)).all()


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    tree, body = three_joints(tmp_path_factory.mktemp("arm"))
    kinds = [j.kind for j in tree.joints]
    experiments = [Experiment(motion(kinds, n, first=first), body) for n, first in ((150, 0), (1200, 300))]
    assembly = build((tree, body), experiments[1], placed(("viscous_friction", "joint1")))
    states = [assembly.evaluate(e, assembly.start) for e in experiments]
    peak = max(float(np.abs(e.motion.qd[:, 1]).max()) for e in experiments)
    travel = max(float(np.ptp(e.motion.q[:, 1])) for e in experiments)
    signals = [Coordinates.of(e, s, 1, peak, travel) for e, s in zip(experiments, states, strict=True)]
    return experiments, states, signals


@pytest.fixture(scope="module")
def curves(arm):
    return {c.words: c for c in family(1, ("joint1", "joint2", "joint3"), arm[2], False)}


def test_the_family_holds_what_every_law_may_run_over(curves):
    assert set(SMALL) < set(curves)
    assert "position and position of joint1 by direction" in curves
    assert "speed of joint3" in curves
    assert not any("joint2" in words for words in curves)


def test_alone_a_joint_has_its_own_coordinates_only(arm):
    assert not any("joint" in c.words for c in family(1, ("joint1", "joint2", "joint3"), arm[2], True))


def test_recordings_share_a_curve(arm, curves):
    """Amplitudes are one function of position in both, whatever part of it each has travelled."""
    q = [x.q[:, 1] for x in arm[2]]
    assert np.ptp(q[0]) < 0.95 * np.ptp(q[1])
    low, high = min(x.min() for x in q), max(x.max() for x in q)
    for x, own in zip(arm[2], q, strict=True):
        np.testing.assert_allclose(curves["position"].columns(x), basis(own, low, high, 0.25, 8), atol=1e-12)


def test_by_direction_a_curve_turns_its_sign_and_else_does_not(arm, curves):
    x = arm[2][1]
    sign = np.tanh(x.qd[:, 1] / (0.006 * np.abs(x.qd[:, 1] / x.speed).max()))
    plain = curves["position"].columns(x)
    np.testing.assert_allclose(curves["position by direction"].columns(x), plain * sign[:, None], atol=1e-9)


@pytest.mark.parametrize(
    ("words", "law"),
    [
        ("speed of joint1 by speed", lambda v, way, w, q: v * np.abs(w)),  # grease that another joint stirs
        ("speed of joint1 by direction", lambda v, way, w, q: way / (1 + w**2)),
        ("position of joint1 by direction", lambda v, way, w, q: way * np.sin(q)),
        ("position of joint1 by speed", lambda v, way, w, q: v * np.cos(q)),
        ("speed and speed of joint1 by direction", lambda v, way, w, q: v * w),
    ],
)
def test_a_law_over_two_joints_is_in_the_curve_over_both(arm, curves, words, law):
    """All but a tenth of it, whatever the law."""
    x = arm[2][1]
    wanted, columns = law(x.qd[:, 1], x.direction, x.qd[:, 0], x.q[:, 0]), curves[words].columns(x)
    left = wanted - columns @ np.linalg.lstsq(columns, wanted, rcond=None)[0]
    assert np.sqrt(np.mean(left**2)) < 0.1 * np.sqrt(np.mean(wanted**2))


def test_load_when_driving_and_when_braking_add_up_to_load_by_direction(arm, curves):
    """Where power flows out of the drive it drives; together they are the friction by load of both."""
    x = arm[2][1]
    both = curves["load when driving"].columns(x) + curves["load when braking"].columns(x)
    wanted = basis(x.load, *ranges(arm[2]), 0.25, 8) * x.direction[:, None]
    np.testing.assert_allclose(both, wanted, atol=1e-9)
    power = x.load * x.qd[:, 1]
    strong = np.abs(power) > np.std(power)
    assert np.mean(np.abs(x.driving - (power > 0))[strong]) < 0.05


def ranges(signals):
    return min(float(x.load.min()) for x in signals), max(float(x.load.max()) for x in signals)


def test_distance_since_a_reversal_starts_anew_at_each(arm):
    x = arm[2][1]
    gone = 10**x.turned - 1
    turns = np.flatnonzero(np.diff(np.sign(x.qd[:, 1])) != 0) + 1
    assert len(turns) > 5
    assert gone[turns] == pytest.approx(0.0, abs=1e-9)
    assert np.all(gone[turns[1:] - 1] > 1)


def test_distance_travelled_never_falls_and_is_the_integral_of_speed(arm):
    e, x = arm[0][1], arm[2][1]
    assert np.all(np.diff(x.path) >= 0)
    assert x.path[-1] == pytest.approx(np.trapezoid(np.abs(e.motion.qd[:, 1]), e.motion.time), rel=0.01)
