"""Columns of nameless curves: hat functions by hand, and what each family adds up to."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest
from moving_arm import exact

from snarelab.identification.search import curves
from snarelab.identification.search.curves import FINE, LOCAL, SMOOTH, TRAVEL, _hats, nameless_columns, smooth_columns

TOGETHER, SPEED = "position, speed, load and time together", "speed, changing with time,"
DIRECTION, EITHER = "direction, changing with time,", "position, apart for either direction,"


def run(q, qd, first=0.0, kinds=("revolute", "prismatic", "revolute")) -> Any:
    n = len(q)
    t = first + 0.1 * np.arange(n)
    names = tuple(f"joint{k + 1}" for k in range(q.shape[1]))
    motion = exact(names, 0.1, 1, (t, q, qd, 0 * q, 0 * q))
    tree = Made(joints=[Made(kind=kind) for kind in kinds])
    return Made(motion=motion, body=Made(tree=tree), elapsed=t - t[0], to_band=lambda x, _c: x)


def random_runs(sizes=(40, 60), n_joints=3):
    """Joints of random position and speed; the last stands at its place."""
    rng = np.random.default_rng(2)
    several = []
    for k, n in enumerate(sizes):
        q, qd = rng.uniform(-1, 2, size=(n, n_joints)) + k, rng.normal(size=(n, n_joints))
        q[:, -1], qd[:, -1] = 0.7, 0.0
        several.append(run(q, qd, 100.0 * k))
    states: Any = [Made(load=rng.normal(size=(n, n_joints))) for n in sizes]
    return several, states


def test_hats_share_each_sample_between_its_two_knots():
    """Knots at 0, 1, 2 of the range of both recordings."""
    one, other = _hats([np.array([0.0, 0.25, 1.0]), np.array([1.5, 2.0])], 3)
    np.testing.assert_allclose(one, [[1, 0, 0], [0.75, 0.25, 0], [0, 1, 0]])
    np.testing.assert_allclose(other, [[0, 0.5, 0.5], [0, 0, 1]])
    assert [x.shape for x in _hats([np.full(3, 2.0), np.full(2, 2.0)], 3)] == [(3, 0), (2, 0)]


def test_smooth_curves_are_eight_hats_each_over_position_speed_load_and_time():
    several, states = random_runs()
    for joint, parts in ((1, 4), (2, 2)):  # of the joint that stands only load and time are left
        columns = smooth_columns(several, states, joint)
        assert [x.shape for x in columns] == [(40, parts * SMOOTH), (60, parts * SMOOTH)]
    names = [[e.motion.q[:, 1] for e in several], [e.motion.qd[:, 1] for e in several]]
    names += [[s.load[:, 1] for s in states], [e.elapsed for e in several]]
    columns = smooth_columns(several, states, 1)
    for k, coordinate in enumerate(names):
        knots = np.linspace(np.concatenate(coordinate).min(), np.concatenate(coordinate).max(), SMOOTH)
        for x, own in zip(columns, coordinate, strict=True):  # with the knots as heights a curve is the straight line
            np.testing.assert_allclose(x[:, SMOOTH * k : SMOOTH * (k + 1)] @ knots, own, atol=1e-12)


def test_curves_without_a_name_add_up_to_what_they_run_over():
    several, states = random_runs()
    found = nameless_columns(several, states, 0)
    fastest = max(np.abs(e.motion.qd[:, 0]).max() for e in several)
    for k, e in enumerate(several):
        speed = e.motion.qd[:, 0]
        forth = 0.5 + 0.5 * np.tanh(100 * speed / fastest)  # over a hundredth of the peak speed of all recordings
        for words, size, whole in ((SPEED, SMOOTH, speed), (DIRECTION, SMOOTH, 2 * forth - 1)):
            assert found[words][k].shape == (len(speed), size)
            np.testing.assert_allclose(found[words][k].sum(axis=1), whole, atol=1e-12)
        half = found[EITHER][k]
        np.testing.assert_allclose(half[:, :TRAVEL].sum(axis=1), forth, atol=1e-12)
        np.testing.assert_allclose(half[:, TRAVEL:].sum(axis=1), 1 - forth, atol=1e-12)
        # Time runs on: a speed that grows as time does is in the span by the knots themselves.
        knots = np.linspace(0.0, max(x.elapsed[-1] for x in several), SMOOTH)
        np.testing.assert_allclose(found[SPEED][k] @ knots, speed * e.elapsed, atol=1e-9)
        both = found["position and speed of joint2"][k]
        np.testing.assert_allclose(both.sum(axis=1), 2.0, atol=1e-12)
        speeds = np.concatenate([x.motion.qd[:, 1] for x in several])
        knots = np.linspace(speeds.min(), speeds.max(), SMOOTH)
        np.testing.assert_allclose(both[:, SMOOTH:] @ knots, e.motion.qd[:, 1], atol=1e-12)
    np.testing.assert_array_equal(found[TOGETHER][1], smooth_columns(several, states, 0)[1])
    # Neither its own nor that of a joint that stands.
    assert [words for words in found if words.startswith("position and speed")] == ["position and speed of joint2"]


@pytest.mark.parametrize(("joint", "unit"), [(0, "rad"), (1, "m")])
def test_places_are_named_by_their_middle(joint, unit):
    """Of 72 knots over the travel, 16 a place and every 8 a new one: the first's middle is at 7.5 of 71 steps."""
    several, states = random_runs()
    found = nameless_columns(several, states, joint)
    q = np.concatenate([e.motion.q[:, joint] for e in several])
    names = [words for words in found if words.startswith("position near")]
    middles = q.min() + np.ptp(q) * (7.5 + 8 * np.arange(8)) / 71
    assert names == [f"position near {x:.3g} {unit}" for x in middles]
    # A place's columns are all there is within it, and nothing beyond.
    for words, x in zip(names, middles, strict=True):
        total = np.concatenate([part.sum(axis=1) for part in found[words]])
        step = np.ptp(q) / (FINE - 1)
        inside, outside = np.abs(q - x) <= (LOCAL - 1) / 2 * step, np.abs(q - x) >= (LOCAL + 1) / 2 * step
        np.testing.assert_allclose(total[inside], 1.0, atol=1e-9)
        np.testing.assert_allclose(total[outside], 0.0, atol=1e-9)


def test_a_joint_that_stands_or_hangs_with_the_others_has_two_curves_alone(monkeypatch):
    several, states = random_runs()
    assert list(nameless_columns(several, states, 2)) == [TOGETHER, SPEED]
    assert len(nameless_columns(several, states, 0)) > 2
    monkeypatch.setattr(curves, "n_carriers", lambda _: 6)
    assert list(nameless_columns(several, states, 0)) == [TOGETHER, SPEED]
    monkeypatch.setattr(curves, "n_carriers", lambda _: 0)
    monkeypatch.setattr(curves, "Rig", Made)
    assert list(nameless_columns(several, states, 0)) == [TOGETHER, SPEED]


def test_one_recording_alone_has_the_same_curves():
    several, states = random_runs()
    assert list(nameless_columns(several[:1], states[:1], 1))[:2] == [TOGETHER, SPEED]
    assert len(nameless_columns(several[:1], states[:1], 1)) == 4 + 8 + 1  # eight places, and one other joint
