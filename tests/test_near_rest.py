"""Which samples are near rest, what bridges them, and what is left of whitened data: counted by hand."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest
from moving_arm import exact

from snarelab.identification.fitting.experiment import Experiment
from snarelab.identification.search import rest
from snarelab.identification.search.rest import (
    CREEP,
    LONGEST_RUN,
    REST,
    Without,
    begun,
    bridged,
    fitted,
    friction_less,
    in_motion,
    moving,
    near_rest,
    slow,
    without,
)


def run(*speeds, thinning=1, segments=None) -> Any:
    """Joints at these speeds; what the rigid body gives is of no concern."""
    qd = np.array(speeds, float).T
    n = len(qd)
    t, torque = 0.01 * np.arange(n), np.arange(n, dtype=float)[:, None] * np.ones(qd.shape)
    names = tuple(f"joint{k + 1}" for k in range(qd.shape[1]))
    body: Any = Made(tree=Made())
    e = Experiment(exact(names, 0.01, thinning, (t, 0 * qd, qd, 0 * qd, torque), segments), body)
    e.__dict__.update(regressor=None, mass_matrix=None, tangent=None, carried=None)
    return e


def at(n, *changed):
    """Full speed, but for some samples: (sample, speed)."""
    speed = np.ones(n)
    for k, x in changed:
        speed[k] = x
    return speed


@pytest.mark.parametrize(
    ("changed", "thinning", "segments", "found"),
    [
        ([(5, 0.0199)], 1, None, [4, 5, 6]),  # below a fiftieth of the peak, and what differentiation mixes with it
        ([(5, 0.02)], 1, None, []),
        ([(5, -0.01)], 1, None, [3, 4, 5, 6]),  # turned between 4 and 5, and at rest there; turned again after it
        ([(k, -1.0) for k in range(10, 20)], 1, None, [8, 9, 10]),  # it turned between 9 and 10
        ([(5, 0.0)], 3, None, [4, 5, 6]),
        ([(5, 0.0)], 4, None, [3, 4, 5, 6, 7]),  # half a kept sample to either side
        ([(9, 0.0)], 1, (slice(0, 10), slice(10, 20)), [8, 9]),  # not over a gap
        ([(10, 0.0)], 1, (slice(0, 10), slice(10, 20)), [10, 11]),
        ([], 1, None, []),
    ],
)
def test_samples_near_rest(changed, thinning, segments, found):
    e = run(at(20, *changed), thinning=thinning, segments=segments)
    assert np.flatnonzero(slow(e, 0)).tolist() == found
    assert not slow(e, 0, 0.0).any()  # a share of nothing


def test_near_rest_is_a_share_of_the_peak_either_way():
    e = run(at(20, (5, 0.3), (15, -10.0)))
    assert np.flatnonzero(slow(e, 0, 0.0301)).tolist() == [4, 5, 6, 13, 14, 15, 16]  # and where it turns
    assert np.flatnonzero(slow(e, 0, 0.03)).tolist() == [13, 14, 15, 16]


def test_a_floating_base_and_a_suspended_arm_are_never_at_rest(monkeypatch):
    e = run(np.zeros(20), at(20, (5, 0.0)))
    monkeypatch.setattr(rest, "n_carriers", lambda _: 1)
    assert not slow(e, 0).any()
    assert slow(e, 1).any()
    monkeypatch.setattr(rest, "Rig", Made)
    assert not slow(e, 1).any()


@pytest.mark.parametrize(
    ("at_rest", "segments", "wanted"),
    [
        ([3, 4], None, [0, 1, 4, 11, 18, 25, 36, 49]),
        ([0, 1], None, [4, 4, 4, 9, 16, 25, 36, 49]),  # nothing before it: what is first seen
        ([6, 7], None, [0, 1, 4, 9, 16, 25, 25, 25]),
        ([1, 2, 6], None, [0, 3, 6, 9, 16, 25, 37, 49]),
        ([3, 4], (slice(0, 4), slice(4, 8)), [0, 1, 4, 4, 25, 25, 36, 49]),  # in each run by itself
        ([0, 1, 2, 3], (slice(0, 4), slice(4, 8)), [0, 1, 4, 9, 16, 25, 36, 49]),  # a run wholly at rest stays
    ],
)
def test_straight_lines_lead_over_what_is_at_rest(at_rest, segments, wanted):
    """Of squares 0, 1, 4, 9 ... ; from 4 to 25 it is 7 a sample."""
    e = run(np.ones(8), segments=segments)
    mask = np.zeros(8, bool)
    mask[at_rest] = True
    np.testing.assert_allclose(rest._bridge(e, mask)(np.arange(8.0) ** 2), wanted)


def test_bridges_lead_over_rest_in_each_channel_and_count_or_not():
    """Torque is the sample's number; the first joint rests at 5 and so from 4 to 6, the second never moves."""
    e = run(at(12, (5, 0.0)), np.zeros(12))
    e.motion.tau[4:7, 0] = 99.0
    over, without_it = bridged(e), moving(e)
    np.testing.assert_allclose(over.measured[:, 0], np.arange(12))
    assert over.kept is None
    np.testing.assert_allclose(without_it.measured[:, 0], [0, 1, 2, 3, 0, 0, 0, 7, 8, 9, 10, 11])
    np.testing.assert_allclose(without_it.measured[:, 1], np.arange(12))  # all that there is
    np.testing.assert_array_equal(without_it.counted, [9, 12])
    np.testing.assert_allclose(e.measured[4:7, 0], 99.0)
    assert bridged(e) is over
    assert moving(e) is without_it
    assert moving(e, (REST, REST)) is without_it
    np.testing.assert_array_equal(moving(e, (0.0, 0.0)).counted, [12, 12])


@pytest.mark.parametrize(
    ("thinning", "changed", "segments", "found", "size"),
    [
        (1, [(5, 0.0)], None, [4, 5, 6], 60),
        # Kept are samples 12, 15, ... 45: the low-pass reaches 12 to either side.
        (3, [(27, 0.0)], None, [5], 12),
        (3, [(28, 0.0)], None, [5], 12),  # 27 to 29
        (3, [(29, 0.0)], None, [6], 12),  # 28 to 30
        (3, [(11, 0.0)], None, [0], 12),
        (3, [(10, 0.0), (47, 0.0)], None, [], 12),
        # Two runs: 12, 15 of the first, 42, 45 of the second.
        (3, [(15, 0.0), (45, 0.0)], (slice(0, 30), slice(30, 60)), [1, 3], 4),
    ],
)
def test_samples_of_the_band_that_are_near_rest(thinning, changed, segments, found, size):
    e = run(at(60, *changed), np.ones(60), thinning=thinning, segments=segments)
    mask = near_rest(e, 0)
    assert np.flatnonzero(mask).tolist() == found
    assert len(mask) == size == len(e.measured)
    both = in_motion([e, e])
    np.testing.assert_array_equal(both, np.tile(np.stack([~mask, np.ones(size, bool)], 1), (2, 1)))


def test_friction_may_fall_short_of_its_level_near_rest():
    """-sgn(v) exp(-(v / w)²) at w = 0.3 and 1 % of the peak speed, here 2."""
    e = run([2.0, 0.006, -0.006, 0.02, 0.0])
    one, other = friction_less(e, 0).T
    np.testing.assert_allclose(one, [0, -np.exp(-1), np.exp(-1), -np.exp(-100 / 9), 0], atol=1e-15)
    np.testing.assert_allclose(other, [0, -np.exp(-0.09), np.exp(-0.09), -np.exp(-1), 0], atol=1e-15)
    assert not friction_less(run(np.zeros(3)), 0).any()


def test_samples_near_rest_count_where_the_model_has_a_law_for_them(monkeypatch):
    """Joint 1 has a law at rest and one that only exceeds its level there, joint 3 the latter alone, joint 2 none."""
    effects = [("a", 0, True, False), ("b", 0, False, True), ("c", 1, False, False), ("d", 2, False, True)]
    placed = [Made(effect=Made(at_rest=a, exceeds_at_rest=x), joint=k) for _, k, a, x in effects]
    assembly: Any = Made(placed=placed, joint_of=lambda p: p.joint, tree=Made(joints=3 * [None]))
    monkeypatch.setattr(rest, "moving", lambda e, shares: (e, shares))
    assert fitted(assembly, ["a recording"]) == [("a recording", [0.0, REST, CREEP])]  # pyright: ignore[reportArgumentType]


def left(missing, segments, order=2, lead=12):
    """How many samples are left of innovations, and of how many."""
    coefficients = np.array([0.5, 0.2])[:order]
    drop = without([missing], [segments], coefficients, lead)
    return int(np.count_nonzero(drop.kept)) + sum(mix.shape[1] for _, mix in drop.combined)


@pytest.mark.parametrize(
    ("at_rest", "segments", "wanted"),
    [
        ([], [(0, 100)], 88),
        ([0, 9], [(0, 100)], 88),  # forgotten by the first innovation, which is 12's
        ([10], [(0, 100)], 87),  # it remembers 10 and 11
        ([0, 60], [(0, 100)], 87),
        ([60], [(0, 12), (12, 100)], 75),  # a run as long as the lead has none
        ([60], [(0, 13), (13, 100)], 1 + 75 - 1),
        ([99], [(0, 100)], 87),
        (range(40, 40 + LONGEST_RUN), [(0, 200)], 188 - LONGEST_RUN),  # combined
        (range(40, 41 + LONGEST_RUN), [(0, 200)], 188 - LONGEST_RUN - 1 - 2),  # dropped with two that remember it
        ([*range(40, 41 + LONGEST_RUN), 150], [(0, 200)], 188 - LONGEST_RUN - 3 - 1),
    ],
)
def test_one_innovation_less_for_every_missing_sample_that_they_remember(at_rest, segments, wanted):
    n = segments[-1][1]
    missing = np.zeros(n, bool)
    missing[list(at_rest)] = True
    assert left(missing, [slice(a, b) for a, b in segments]) == wanted


def test_recordings_stand_one_behind_the_other():
    """The second recording's missing sample 20, by its third innovation on: 30 + 8 to 30 + 10."""
    none, one = np.zeros(42, bool), np.zeros(42, bool)
    one[20] = True
    drop = without([none, one], [[slice(0, 42)], [slice(0, 42)]], np.array([0.5, 0.2]), 12)
    assert np.flatnonzero(~drop.kept).tolist() == [38, 39, 40]
    ((rows, mix),) = drop.combined
    assert (rows, mix.shape) == (slice(38, 41), (3, 2))
    np.testing.assert_allclose(mix.T @ [1.0, -0.5, -0.2], 0.0, atol=1e-12)
    assert without([], [], np.zeros(0), 12)(np.zeros(0)).shape == (0,)


def test_what_is_left_stands_in_the_order_of_time_and_a_combination_where_it_begins():
    mix = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 2.0]])
    kept = np.array([True, True, False, False, False, True, False, True])
    drop = Without(kept, ((slice(2, 5), mix),))
    np.testing.assert_allclose(drop(np.arange(8.0)), [0, 1, 2, 8, 5, 7])
    np.testing.assert_array_equal(drop.first(np.array([0, 0, 1, 1, 2, 2, 3, 3])), [0, 0, 1, 1, 2, 3])
    two = Without(kept[:5], ((slice(0, 1), np.ones((1, 1))), (slice(3, 5), np.ones((2, 1)))))
    np.testing.assert_allclose(two(np.arange(1.0, 6.0)), [1, 2, 9])
    np.testing.assert_array_equal(two.first(np.arange(5)), [0, 1, 3])


def test_before_its_first_motion_a_joint_counts_for_nothing_and_from_then_on_all_of_it_does():
    """Of two runs, each begins at rest; the first joint turns back in the second. The other joint never stands."""
    speed = at(20, *((k, 0.0) for k in (0, 1, 2, 10, 11)), (15, 0.0))
    e = run(speed, np.ones(20), segments=(slice(0, 10), slice(10, 20)))
    kept = begun(e).kept
    assert kept is not None
    assert np.flatnonzero(~kept[:, 0]).tolist() == [0, 1, 2, 3, 10, 11, 12]  # and one that differentiation mixes in
    assert kept[:, 1].all()
    assert begun(e) is begun(e)
    assert (begun(e).bridged, begun(e).measured.shape) == ((), e.measured.shape)


def test_a_joint_that_never_moves_counts_whole():
    kept = begun(run(np.ones(20), np.zeros(20))).kept
    assert kept is not None
    assert kept.all()
