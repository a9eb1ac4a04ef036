"""Vibration that comes and goes: which windows count, how loud they are, and from when on they are bursts."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest

from snarelab.identification.search import bursts as module
from snarelab.identification.search.bursts import _windows, bursts

LENGTH = 50
"""Samples of half a second at 100 Hz, twice the band."""


def run(band=50.0, n=0, n_joints=1) -> Any:
    return Made(motion=Made(band=band), measured=np.zeros((n, n_joints)), body=Made(tree=Made()))


def steps(*levels):
    """Windows of a constant level."""
    return np.repeat(np.array(levels, float), LENGTH)


def always(x):
    return np.ones(len(x), bool)


def test_windows_are_whole_half_seconds_in_each_recordings_own_rate():
    """100 and 40 samples a second: 50 and 20 a window; what is left over at the end is no window."""
    one, other = np.concatenate([steps(1, 2), np.full(LENGTH - 1, 9.0)]), np.repeat([3.0, 4.0, 5.0], 20)
    strength, _ = _windows([run(50.0), run(20.0)], [one, other], [always(one), always(other)])
    np.testing.assert_allclose(strength, [1, 4, 9, 16, 25])


def test_a_window_counts_if_half_of_it_is_in_motion_and_by_that_half():
    residual = steps(2, 2, 2)
    residual[:25] = 7.0  # at rest
    moving = always(residual)
    moving[:25] = False
    moving[LENGTH : LENGTH + 26] = False  # one sample more than half
    strength, _ = _windows([run()], [residual], [moving])
    np.testing.assert_allclose(strength, [4, 4])
    moving[:] = False
    strength, frequency = _windows([run()], [residual], [moving])
    assert (len(strength), frequency) == (0, 0.0)


def test_a_band_below_the_windows_own_rate_still_has_two_samples_a_window():
    strength, _ = _windows([run(0.5)], [np.array([1.0, 3.0, 2.0, 4.0])], [np.ones(4, bool)])
    np.testing.assert_allclose(strength, [5, 10])


@pytest.mark.parametrize(("band", "hertz"), [(50.0, 20.0), (50.0, 31.0), (20.0, 12.0)])
def test_the_frequency_is_that_of_the_loudest_window(band, hertz):
    length = round(band)  # half a second
    t = np.arange(3 * length) / (2 * band)
    residual = np.where(t < 0.5, 1.0, 3.0) * np.sin(2 * np.pi * np.where(t < 0.5, 7.0, hertz) * t)
    residual[2 * length :] *= 0.1
    _, frequency = _windows([run(band)], [residual], [always(residual)])
    assert frequency == pytest.approx(hertz, abs=0.15)


def found(monkeypatch, residuals, moving=None, heard=((0.0,),)):
    """`bursts` for residuals (n, J) of recordings at 100 Hz; ``heard`` is what the encoders' noise leaves of each."""
    experiments = [run(n=len(r), n_joints=r.shape[1]) for r in residuals]
    moving = [np.ones(r.shape, bool) for r in residuals] if moving is None else moving
    noise = {id(e): np.array(h, float) for e, h in zip(experiments, heard, strict=True)}
    answers = {id(e): r for e, r in zip(experiments, residuals, strict=True)}
    monkeypatch.setattr(module, "in_motion", lambda _: np.concatenate(moving))
    monkeypatch.setattr(module, "bridged", lambda e: e)
    monkeypatch.setattr(module, "encoder_torque", lambda _, e: noise[id(e)])
    assembly = Made(residual=lambda e, _theta: (answers[id(e)], []))
    return bursts(Made(assembly=assembly, theta=None), experiments)  # pyright: ignore[reportArgumentType]


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
def test_bursts_are_a_fifth_of_the_energy_beyond_three_times_the_median(monkeypatch, energies, share, again):
    answer = found(monkeypatch, [steps(*np.sqrt(energies))[:, None]])
    if share is None:
        assert answer == {}
    else:
        assert answer[0].share == pytest.approx(share)
        assert answer[0].again is again


def test_what_the_encoders_leave_counts_one_and_a_half_times_among_the_ordinary(monkeypatch):
    """RMS 2 and 0 in two recordings: 2 on average of the squares, so that 1 + 1.5 * 2 = 4 is usual, and 12 the bar."""
    first, second = steps(*5 * [1], np.sqrt(20))[:, None], steps(*5 * [1], np.sqrt(20))[:, None]
    answer = found(monkeypatch, [first, second], heard=((2.0,), (0.0,)))
    assert answer[0].share == pytest.approx(2 * 8 / 50)
    assert found(monkeypatch, [first, second], heard=((2.0,), (2.0,))) == {}  # 1 + 6: 21 and more would be loud


def test_every_channel_has_its_own_windows_and_rest(monkeypatch):
    """The second channel's joint stands in the second recording, where its residual is loud."""
    quiet, loud = steps(*12 * [1]), steps(*10 * [1], 4, 4)
    moving = [np.ones((600, 2), bool), np.ones((600, 2), bool)]
    moving[1][:, 1] = False
    recordings = [np.stack([loud, quiet], 1), np.stack([quiet, 9 * loud], 1)]
    answer = found(monkeypatch, recordings, moving, heard=((0.0, 0.0), (0.0, 0.0)))
    assert list(answer) == [0]
    assert answer[0].share == pytest.approx(26 / (22 + 32))
    moving[1][:, 1] = True
    assert list(found(monkeypatch, recordings, moving, heard=((0.0, 0.0), (0.0, 0.0)))) == [0, 1]


@pytest.mark.parametrize(("name", "stand_in"), [("n_carriers", lambda _: 6), ("Rig", Made)])
def test_nothing_is_said_where_every_joint_moves_what_carries_the_others(monkeypatch, name, stand_in):
    """A floating base; a suspension."""
    loud = [steps(*10 * [1], 4, 4)[:, None]]
    assert list(found(monkeypatch, loud)) == [0]
    monkeypatch.setattr(module, name, stand_in)
    assert found(monkeypatch, loud) == {}
