"""Which samples are near rest, and what bridges them: counted by hand."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest
from moving_arm import exact

from snarelab.identification.fitting.experiment import Experiment
from snarelab.identification.search import rest
from snarelab.identification.search.rest import (
    CREEP,
    REST,
    fitted,
    moving,
    near_rest,
    slow,
)
from snarelab.models.floating.ets_vii import ets_vii
from snarelab.models.floating.tree import floating_tree
from snarelab.models.rig.rig import built_in_rig


def run(*speeds, thinning=1, segments=None) -> Any:
    """Joints at these speeds; what the rigid body gives is of no concern."""
    qd = np.array(speeds, float).T
    n = len(qd)
    t, torque = 0.01 * np.arange(n), np.arange(n, dtype=float)[:, None] * np.ones(qd.shape)
    names = tuple(f"joint{k + 1}" for k in range(qd.shape[1]))
    body: Any = Made(tree=Made(sticks=lambda _: True))
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


def test_what_cannot_stick_is_never_at_rest():
    """A floating base, and the joints of an arm that hangs."""
    e = run(np.zeros(20), at(20, (5, 0.0)))
    e.body.tree.sticks = lambda joint: joint > 0
    assert not slow(e, 0).any()
    assert slow(e, 1).any()


def test_trees_say_what_sticks_and_what_stands():
    rig, floating, arm = built_in_rig(), floating_tree(ets_vii()), ets_vii().tree
    assert [t.stands for t in (rig, floating, arm)] == [False, False, True]
    assert [rig.sticks(0), arm.sticks(0)] == [False, True]
    assert [floating.sticks(c) for c in (0, 5, 6)] == [False, False, True]


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
    without_it = moving(e)
    np.testing.assert_allclose(without_it.measured[:, 0], [0, 1, 2, 3, 0, 0, 0, 7, 8, 9, 10, 11])
    np.testing.assert_allclose(without_it.measured[:, 1], np.arange(12))  # all that there is
    np.testing.assert_array_equal(without_it.counted, [9, 12])
    np.testing.assert_allclose(e.measured[4:7, 0], 99.0)
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
    np.testing.assert_array_equal(near_rest(e, 1), np.zeros(size, bool))


def test_samples_near_rest_count_where_the_model_has_a_law_for_them(monkeypatch):
    """Joint 1 has a law at rest and one that only exceeds its level there, joint 3 the latter alone, joint 2 none."""
    laws = [(0, True, False), (0, False, True), (1, False, False), (2, False, True)]
    assembly = model([(np.eye(3)[k], a, x, True) for k, a, x in laws])
    monkeypatch.setattr(rest, "moving", lambda e, shares, axes: (e, shares, axes))
    assert fitted(assembly, ["a recording"]) == [("a recording", [0.0, REST, CREEP], ())]  # pyright: ignore[reportArgumentType]


def model(laws) -> Any:
    """Laws at places of three joints: factors, whether they hold at rest, exceed their level there, and dissipate."""
    placed = []
    for along, at_rest, exceeds, dissipates in laws:
        law = Made(at="joint", acts_on="torque", at_rest=at_rest, exceeds_at_rest=exceeds, dissipates=dissipates)
        along = np.array(along)
        alone = int(along.argmax()) if np.count_nonzero(along) == 1 else None
        placed.append(Made(effect=law, at=str(along), place=Made(along=along, alone=alone)))
    return Made(placed=placed, place_of=lambda p: p.place, tree=Made(joints=3 * [None]))


def test_where_an_axis_that_rubs_rests_none_of_its_joints_counts():
    """Two joints turn against each other at sample 5, so that their sum rests; the third has no part in it."""
    e = run(np.ones(12), at(12, (5, -1.0)), np.ones(12))
    e.body.tree.sticks = lambda _: True
    plus = (1.0, 1.0, 0.0)

    def counted(*laws):
        (found,) = fitted(model(laws), [e])
        return found.counted.tolist()

    turns = [12, 9, 12]  # the second joint's own: 4 and 5, and what is mixed with them
    assert counted((plus, False, False, False))[0] == 12
    both = counted((plus, False, False, True))
    assert both[0] == 9
    assert both[1] <= turns[1]
    assert both[2] == 12
    assert counted((plus, True, False, True))[0] == 12  # a law of friction at rest
