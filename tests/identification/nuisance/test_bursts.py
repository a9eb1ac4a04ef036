"""Vibration that comes and goes: which windows count, how loud they are, and from when on they are bursts."""

import numpy as np
import pytest
from loud_windows import LENGTH, STEP, windows

from snarelab.identification.nuisance.bursts import ChannelResidual, bursts


@pytest.mark.parametrize(
    ("energies", "share", "again"),
    [
        # The median is 1, so that what exceeds 3 is out of the ordinary: of two windows of 16, 13 each of 42 in all.
        ([16, *10 * [1], 16], 26 / 42, True),
        ([*11 * [1], 16], 13 / 27, False),  # it came once
        ([16, *10 * [1], 4], 14 / 30, False),  # without the loudest, 1 of 14 is no burst
        ([16, *10 * [1], 6.6], 16.6 / 32.6, True),
        ([*11 * [1], 6.6], 3.6 / 17.6, False),  # 0.2045
        ([*11 * [1], 6.4], None, False),  # 3.4 of 17.4: 0.195
        ([*10 * [1], 16], None, False),  # of eleven windows a median says nothing
        (12 * [1], None, False),
    ],
)
def test_bursts_are_a_fifth_of_the_energy_beyond_three_times_the_median(energies, share, again):
    own = [windows(*energies)]
    found = bursts(own, own)
    if share is None:
        assert found is None
    else:
        assert found is not None
        assert found.share == pytest.approx(share)
        assert found.again is again


def test_bursts_come_again_where_the_held_out_recordings_have_them_too():
    train = [windows(16, *10 * [1], 16)]
    for held, again in (([*11 * [1], 16], True), (12 * [1], False), ([*10 * [1], 16], False)):  # eleven say nothing
        found = bursts(train, [windows(*held)])
        assert found is not None
        assert found.share == pytest.approx(26 / 42)
        assert found.again is again


def test_windows_are_whole_half_seconds_in_each_recordings_own_rate():
    """What is left over at the end is no window: six windows and twelve at 40 Hz, the loud ones among them."""
    first, second = windows(1, 1, 1, 1, 1, 16), windows(1, 1, 1, 1, 1, 16, step=0.025)
    tail = ChannelResidual(np.append(first.residual, 99.0), np.append(first.energy, 99.0**2), np.ones(301, bool), STEP)
    found = bursts([tail, second], [tail, second])
    assert found is not None
    assert found.share == pytest.approx(26 / 42)
    assert found.again


@pytest.mark.parametrize("hertz", [12.0, 31.0])
def test_the_frequency_is_that_of_the_loudest_window(hertz):
    t = STEP * np.arange(12 * LENGTH)
    loud = (t >= 2.0) & (t < 2.5)
    residual = np.where(loud, 9.0, 1.0) * np.sin(2 * np.pi * np.where(loud, hertz, 7.0) * t)
    found = bursts([ChannelResidual(residual, residual**2, np.ones(len(t), bool), STEP)], [])
    assert found is not None
    assert found.frequency == pytest.approx(hertz, abs=0.15)


def test_what_happens_near_rest_is_no_burst():
    """A window counts by the half of it that is in motion."""
    own = windows(*5 * [1.0], 16.0, *5 * [1.0], 16.0)
    loud = own.energy > 1
    assert bursts([own], []) is not None
    assert (
        bursts([ChannelResidual(own.residual, own.energy, ~loud, STEP)], []) is None
    )  # of ten windows a median says nothing
    energy, moves = own.energy.copy(), np.ones(len(loud), bool)
    energy[np.flatnonzero(loud)[::2]] = 1e6
    moves[np.flatnonzero(loud)[::2]] = False
    found = bursts([ChannelResidual(own.residual, energy, moves, STEP)], [])
    assert found is not None
    assert found.share == pytest.approx((0.5 * 13 + 0.5 * 13) / (0.5 * 16 + 0.5 * 16 + 10))


def test_what_is_slower_than_a_window_is_none():
    t = STEP * np.arange(12 * LENGTH)
    residual = np.where((t >= 2.0) & (t < 3.0), 9.0, 1.0) * np.cos(2 * np.pi * 0.5 * t)
    assert bursts([ChannelResidual(residual, residual**2, np.ones(len(t), bool), STEP)], []) is None
