"""What captures are compared by, the likelihood of what is left, and the channels of results: counted by hand."""

import numpy as np
import pytest
from captures_by_hand import along, capture, fit_of, track
from scipy.spatial.transform import Rotation

from snarelab.identification.snare.channels import ChannelError, channel_errors, channels, modelled
from snarelab.identification.snare.comparison import (
    blocks,
    floor,
    likelihood,
    price,
    residual,
    scales,
    slow_means,
    variances,
)
from snarelab.models.snare.target import Target


@pytest.mark.parametrize(("rows", "means"), [(4, []), (5, [2.0]), (9, [2.0]), (10, [2.0, 7.0]), (14, [2.0, 7.0])])
def test_a_quarter_of_a_second_is_five_times_and_what_is_left_of_one_is_dropped(rows, means):
    """Rows 0, 1, 2, ...: the mean of five of them is the middle one; the second column is ten times the first."""
    x = np.outer(np.arange(rows), [1.0, 10.0])
    np.testing.assert_allclose(slow_means(x), np.outer(means, [1.0, 10.0]).reshape(-1, 2))


def chattering(size):
    """A force (20, 3) of 2 N along y that swings by so much, +, -, 0, +, - of it in each quarter of a second."""
    return np.outer(np.ones(20), [0.0, 2.0, 0.0]) + np.outer(np.tile([1.0, -1.0, 0.0, 1.0, -1.0], 4), [size, 0, size])


@pytest.mark.parametrize("size", [0.0, 0.03, 4.0])
def test_chatter_is_the_size_of_what_a_force_does_about_its_quarters_means(size):
    """Along x and z four of five times by ``size``: a mean square of 1.6 size². Noise of 10 mN and 50 mN are none."""
    force = chattering(size)
    own = capture(track(np.zeros((20, 3)), effector=force), noise=0.01)
    found = blocks(own, own.measured)
    assert list(found) == ["position", "slow.effector", "chatter.effector"]
    np.testing.assert_allclose(found["slow.effector"], np.tile([0.0, 2.0, 0.0], (4, 1)), atol=1e-12)
    expected = 0.5 * np.log(1.6 * size**2 + 0.06**2)
    np.testing.assert_allclose(found["chatter.effector"], [[expected], [expected]], rtol=1e-12)


def test_chatter_counts_whole_half_seconds():
    """Fourteen times hold two quarters but one half second; nineteen hold three quarters, and one still."""
    for rows in (14, 19):
        own = capture(track(np.zeros((rows, 3)), effector=chattering(1.0)[:rows]))
        assert blocks(own, own.measured)["chatter.effector"].shape == (1, 1)
        assert blocks(own, own.measured)["slow.effector"].shape == (rows // 5, 3)


@pytest.mark.parametrize("turns_by_itself", [True, False])
def test_orientation_counts_from_the_start_and_only_where_it_is_part_of_the_motion(turns_by_itself):
    """From 90 deg about z at the start, by 0.2 rad about x in the world: a rotation vector of (0.2, 0, 0)."""
    start = Rotation.from_rotvec([0.0, 0.0, np.pi / 2])
    turned = np.tile((Rotation.from_rotvec([0.2, 0.0, 0.0]) * start).as_quat(scalar_first=True), (10, 1))
    turned[7] = np.nan
    inertia = np.eye(3).tolist() if turns_by_itself else None
    target = Target("free", orientation=start.as_quat(scalar_first=True).tolist(), inertia=inertia)
    own = capture(track(np.zeros((10, 3)), turned), target=target)
    found = blocks(own, own.measured)
    assert ("turn" in found) is turns_by_itself
    if turns_by_itself:
        np.testing.assert_allclose(found["turn"][0], [0.2, 0.0, 0.0], atol=1e-12)
        assert np.isnan(found["turn"][1]).all()  # a gap in the second quarter


def test_a_residual_is_measurement_less_simulation_and_nothing_where_nothing_was_measured():
    measured = along(0.5, (0.2, 0.3, 0.4))
    measured[6, 2] = np.nan
    simulated = along(0.1, (0.3, 0.1, 0.1))
    found = residual(capture(track(measured)), track(simulated))
    np.testing.assert_allclose(found["position"], [[0.4, 0.0, 0.0], [-0.1, 0.2, 0.0]], atol=1e-12)


@pytest.mark.parametrize(
    ("block", "least"),
    [
        ("position", np.hypot(1.5e-4, 0.02 / np.sqrt(5))),  # a quarter's mean scatters by a root of five less
        ("turn", 4e-3),
        ("slow.effector", np.hypot(0.05 + 0.02 * 7.0, 0.02 / np.sqrt(5))),  # 50 mN and a fiftieth of what it carries
        ("chatter.effector", 0.15),
    ],
)
def test_the_least_that_a_number_counts_for(block, least):
    own = capture(track(along(0.0), effector=np.zeros((5, 3))), noise=0.02, carried=7.0)
    assert floor(own, block) == pytest.approx(least, rel=1e-12)


def two_captures():
    """Positions of two and of three numbers whose floors are 0.3 and 0.4 (with LEAST so small that it is nothing)."""
    own = [capture(track(along(0.0)), noise=f * np.sqrt(5)) for f in (0.3, 0.4)]
    return own, [{"position": np.array([[1.0, 2.0]])}, {"position": np.array([[3.0, 0.0, 1.0]])}]


def test_a_blocks_scale_is_one_for_all_captures_with_each_ones_own_floor():
    """Squares 1 + 4 + 9 + 0 + 1 = 15, floors 2 · 0.09 + 3 · 0.16 = 0.66, over five numbers."""
    own, left = two_captures()
    size, variance = scales(own, left)["position"]
    assert size == 5
    assert variance == pytest.approx(15.66 / 5, rel=1e-5)
    # One of four numbers is news: what their squares are divided by is four times that.
    assert variances(own, left)["position"] == pytest.approx(4 * 15.66 / 5, rel=1e-5)
    assert likelihood(own, left) == pytest.approx(-0.5 * 5 / 4 * np.log(15.66 / 5), rel=1e-5)
    assert price(left) == pytest.approx(0.5 * np.log(5 / 4), rel=1e-12)


def test_blocks_add_up_and_each_has_its_own_scale():
    """Two numbers of 3 mm and four of 2 in the logarithm: L = -1/8 (2 ln(9e-6 + f²) + 4 ln(4 + 0.15²))."""
    own = [capture(track(along(0.0), effector=np.zeros((5, 3))), noise=0.0)]
    left = [{"position": np.full((1, 2), 3e-3), "chatter.effector": np.full((2, 2), 2.0)}]
    expected = -(2 * np.log(9e-6 + 2.25e-8) + 4 * np.log(4.0225)) / 8
    assert likelihood(own, left) == pytest.approx(expected, rel=1e-12)
    assert price(left) == pytest.approx(0.5 * np.log(6 / 4), rel=1e-12)


# Channels


def moving(force=True):
    """From (1, 2, 3) m to (1.3, 2, 2.6) m after a quarter of a second; 4 N and then 2 N along y."""
    push = np.repeat([[0.0, 4.0, 0.0], [0.0, 2.0, 0.0]], 5, axis=0)
    return track(along((1.0, 2.0, 3.0), (1.3, 2.0, 2.6)), **({"effector": push} if force else {}))


def test_channels_are_the_positions_axes_then_the_forces_at_the_quarters_middles():
    """Times of five samples 50 ms apart: the middle one, 0.1 s after the first, on the recording's clock."""
    found = channels(capture(moving(), zero=20.0, sensor="wrist"))
    assert [c.name for c in found] == [f"pos.target.{a}" for a in "xyz"] + [f"force.wrist.{a}" for a in "xyz"]
    assert [c.unit for c in found] == ["m"] * 3 + ["N"] * 3
    for c in found:
        np.testing.assert_allclose(c.times, [20.1, 20.35], rtol=1e-12)
    np.testing.assert_allclose(found[2].measured, [3.0, 2.6])
    np.testing.assert_allclose(found[4].measured, [4.0, 2.0])
    np.testing.assert_allclose(found[5].place, [3.0, 2.6])  # forces along z are drawn against the position along z
    np.testing.assert_allclose(found[2].relative_to(), [0.0, -0.4], atol=1e-12)
    np.testing.assert_allclose(found[4].relative_to(), [4.0, 2.0])
    np.testing.assert_allclose(modelled(capture(moving()), moving()), [c.measured for c in found])


def test_an_error_of_position_is_relative_to_the_motion_and_one_of_force_to_the_force():
    """Two captures of two quarters: x misses by 3 cm and 1 cm in one, by nothing in the other; the force by 1 N."""
    nearly = track(
        along((0.97, 2.0, 3.0), (1.29, 2.0, 2.6)), effector=moving().force["effector"] + np.array([0.0, 1.0, 0.0])
    )
    own = [capture(moving()), capture(moving(), path="b.csv")]
    found = {e.channel: e for e in channel_errors(own, fit_of((), [], 0.0, tracks=[nearly, moving()]))}
    x, y, force = found["pos.target.x"], found["pos.target.y"], found["force.wrist.y"]
    assert (x.unit, force.unit) == ("m", "N")
    assert x.rms == pytest.approx(np.sqrt((9e-4 + 1e-4) / 4))
    assert x.reference == pytest.approx(np.sqrt(2 * 0.3**2 / 4))
    assert x.relative == pytest.approx(np.sqrt(1e-3 / 0.18))
    assert (y.rms, y.reference, y.relative) == (0.0, 0.0, 0.0)
    assert force.rms == pytest.approx(np.sqrt(2 / 4))
    assert force.reference == pytest.approx(np.sqrt((2 * 16 + 2 * 4) / 4))


def test_where_nothing_was_measured_no_error_counts():
    """A force known in the second quarter only, 2 N where the simulation has 5 N."""
    force = moving().force["effector"].copy()
    force[:5] = np.nan
    own = capture(track(moving().position, effector=force))
    simulated = track(moving().position, effector=np.full((10, 3), 5.0))
    found = {e.channel: e for e in channel_errors([own], fit_of((), [], 0.0, tracks=[simulated]))}
    assert found["force.wrist.y"].rms == pytest.approx(3.0)
    assert found["force.wrist.y"].reference == pytest.approx(2.0)
    force[:] = np.nan
    none = capture(track(moving().position, effector=force))
    errors = {e.channel: e for e in channel_errors([none], fit_of((), [], 0.0, tracks=[simulated]))}
    assert errors["force.wrist.x"] == ChannelError("force.wrist.x", "N", 0.0, 0.0)
