"""Which samples stand near rest, along a motion whose speed is known."""

import numpy as np
import pytest
from moving_arm import exact
from near_rest_of import PEAK, PERIOD, near_rest

from snarelab.identification.nuisance.rest import Zone, share


def test_what_is_slower_than_a_share_of_the_peak_stands_near_rest():
    speed = [2.0, 0.2, 0.079, 0.0, -0.079, -0.081, -2.0]  # 4 % of 2 is 0.08
    assert near_rest(speed, Zone(0.04, 0.0)) == [2, 3, 4]


def test_a_reversal_between_two_samples_counts():
    assert near_rest([1.0, 1.0, -1.0, -1.0], Zone(0.04, 0.0)) == [1]


def test_noise_of_the_encoder_widens_it_by_two_deviations():
    speed = [1.0, 0.1, 0.01, 0.1, 1.0]
    assert near_rest(speed, Zone(0.04, 0.0)) == [2]
    assert near_rest(speed, Zone(0.04, 0.0), noise=0.011) == [1, 2, 3]


@pytest.mark.parametrize("travel", [1.0, 3.0])
def test_and_so_does_what_has_not_gone_a_share_of_the_travel_since(travel):
    """At 1 rad/s a sample goes 0.01, so that 0.05 of the travel is gone after 5 or 15."""
    speed = np.concatenate([np.zeros(5), np.ones(40)])
    found = near_rest(speed, Zone(0.04, 0.0499), travel)
    assert found == list(range(5 + round(5 * travel)))


def test_a_gap_ends_it():
    """What a joint did before a gap says nothing of it afterwards."""
    speed = np.concatenate([np.ones(5), np.zeros(5), np.ones(10)])
    whole = near_rest(speed, Zone(0.04, 0.05))
    parted = near_rest(speed, Zone(0.04, 0.05), segments=(slice(0, 10), slice(10, 20)))
    assert whole == list(range(5, 15))
    assert parted == list(range(5, 10))


def test_a_joint_in_motion_never_stands():
    assert near_rest(1 + 0.5 * np.sin(np.arange(100) / 10), Zone(0.04, 0.01)) == []


def test_an_axis_stands_where_its_joints_turn_against_each_other():
    """The sum of two speeds is 0.06 at one sample, below 4 % of 2; the second joint counts twice in it."""
    speeds = np.array([[1.0, 0.5], [1.0, -0.47], [1.0, 0.5]])
    t = PERIOD * np.arange(3)
    made = exact(
        ("joint1", "joint2"), PERIOD, 1, (t, np.cumsum(speeds, axis=0) * PERIOD, speeds, 0 * speeds, 0 * speeds)
    )
    found = [np.flatnonzero(share(made, np.array(x), Zone(0.04, 0.0), PEAK, 1.0)).tolist() for x in ((1, 2), (1, 0))]
    assert found == [[1], []]
    made.encoder_noise[1] = 0.0, 0.3  # counts twice, and twice its deviation: 1.2 of the sums of 2
    assert np.flatnonzero(share(made, np.array([1.0, 1.0]), Zone(0.04, 0.0), PEAK, 1.0)).tolist() == [1]


def test_thinned_samples_hold_a_share():
    """Through the conditioning's own low-pass: between 0 and 1, one deep inside a rest and none far from it."""
    n = 1200
    qd = np.where((np.arange(n) > 400) & (np.arange(n) < 800), 0.0, 1.0)[:, None]
    t = PERIOD * np.arange(n)
    made = exact(("joint1",), PERIOD, 3, (t, np.cumsum(qd, axis=0) * PERIOD, qd, 0 * qd, 0 * qd))
    found = share(made, np.ones(1), Zone(0.04, 0.0), PEAK, 1.0)
    time = made.to_band(made.time)
    assert found.min() >= 0
    assert found.max() <= 1
    assert found[(time > 4.5) & (time < 7.5)] == pytest.approx(1.0, abs=0.01)
    assert found[(time < 3.5) | (time > 8.5)] == pytest.approx(0.0, abs=0.01)
    assert len(found) == len(time) < n / 2
