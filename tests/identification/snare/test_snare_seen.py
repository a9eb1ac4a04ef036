"""What captures are compared by, channel by channel: counted by hand."""

import numpy as np
import pytest
from captures_by_hand import along, capture, track
from scipy.spatial.transform import Rotation

from snarelab.identification.snare.seen import channels, motion, seen, shown, slow_means, times, unit_of
from snarelab.models.snare.target import Target


@pytest.mark.parametrize(("rows", "means"), [(4, []), (5, [2.0]), (9, [2.0]), (10, [2.0, 7.0]), (14, [2.0, 7.0])])
def test_a_quarter_of_a_second_is_five_times_and_what_is_left_of_one_is_dropped(rows, means):
    """Rows 0, 1, 2, ...: the mean of five of them is the middle one; the second column is ten times the first."""
    x = np.outer(np.arange(rows), [1.0, 10.0])
    np.testing.assert_allclose(slow_means(x), np.outer(means, [1.0, 10.0]).reshape(-1, 2))


@pytest.mark.parametrize("size", [0.0, 0.03, 4.0])
def test_chatter_is_the_size_of_what_a_force_does_about_its_quarters_means(size):
    """Along x and z four of five times by ``size``: a mean square of 1.6 size². Noise of 10 mN and 50 mN are none."""
    swing = np.outer(np.tile([1.0, -1.0, 0.0, 1.0, -1.0], 4), [size, 0, size])
    own = capture(track(np.zeros((20, 3)), effector=np.outer(np.ones(20), [0.0, 2.0, 0.0]) + swing), noise=0.01)
    found = seen(own, own.measured)
    assert channels(own) == (*(f"pos.target.{a}" for a in "xyz"), *(f"force.wrist.{a}" for a in "xyz"), "chatter.wrist")
    np.testing.assert_allclose(found[:, 3:6], np.tile([0.0, 2.0, 0.0], (4, 1)), atol=1e-12)
    np.testing.assert_allclose(found[:, 6], 0.5 * np.log(1.6 * size**2 + 0.06**2), rtol=1e-12)


@pytest.mark.parametrize("turns_by_itself", [True, False])
def test_orientation_counts_from_the_start_and_only_where_it_is_part_of_the_motion(turns_by_itself):
    """From 90 deg about z at the start, by 0.2 rad about x in the world: a rotation vector of (0.2, 0, 0)."""
    start = Rotation.from_rotvec([0.0, 0.0, np.pi / 2])
    turned = np.tile((Rotation.from_rotvec([0.2, 0.0, 0.0]) * start).as_quat(scalar_first=True), (10, 1))
    turned[7] = np.nan
    inertia = np.eye(3).tolist() if turns_by_itself else None
    target = Target("free", orientation=start.as_quat(scalar_first=True).tolist(), inertia=inertia)
    own = capture(track(np.zeros((10, 3)), turned), target=target)
    found = seen(own, own.measured)
    assert ("turn.target.x" in channels(own)) is turns_by_itself
    assert found.shape == (2, 6 if turns_by_itself else 3)
    if turns_by_itself:
        np.testing.assert_allclose(found[0, 3:], [0.2, 0.0, 0.0], atol=1e-12)
        assert np.isnan(found[1, 3:]).all()  # a gap in the second quarter


def test_times_are_the_quarters_middles_on_the_recordings_clock():
    own = capture(track(along(0.0, 0.0)), zero=20.0)
    np.testing.assert_allclose(times(own), [20.1, 20.35], rtol=1e-12)


def test_a_position_counts_from_where_it_was_first_known_and_a_force_from_nothing():
    place = along((9.0, 9.0, 9.0), (1.0, 2.0, 3.0), (1.3, 2.0, 2.6))
    place[:5] = np.nan
    force = np.full((15, 3), 4.0)
    own = capture(track(place, effector=force))
    found = motion(own)
    np.testing.assert_allclose(found[1:, :3], [[0.0, 0.0, 0.0], [0.3, 0.0, -0.4]], atol=1e-12)
    np.testing.assert_allclose(found[:, 3:6], 4.0)


def test_motion_and_force_are_shown_turns_and_chatter_are_not():
    names = ["pos.target.x", "turn.target.x", "force.wrist.x", "chatter.wrist"]
    assert [unit_of(n) for n in names] == ["m", "rad", "N", "1"]
    assert shown(names) == [0, 2]
