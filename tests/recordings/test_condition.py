"""From a recording to motion and torques in one band: exact where it says so."""

from dataclasses import replace

import numpy as np
import pytest
from condition_signals import BAND, RATE, clock, noted, recording, sine

from snarelab.errors import InputError
from snarelab.recordings.condition import LEAST_KEPT, MINIMUM_SAMPLES, condition


@pytest.mark.parametrize("frequency", [0.3, 2.0, 7.0, 12.0, 17.0, 20.0])
def test_derivatives_of_a_sine_in_the_band(frequency):
    t = clock()
    motion = condition(recording(t, sine(t, frequency)[0]), ["joint1"], BAND)
    for found, wanted in zip((motion.q, motion.qd, motion.qdd), sine(motion.time, frequency), strict=True):
        assert np.max(np.abs(found[:, 0] - wanted)) < 2e-3 * np.max(np.abs(wanted))


def test_motion_above_the_band_is_stopped():
    t = clock()
    motion = condition(recording(t, sine(t, 90.0)[0]), ["joint1"], BAND)
    for found, size in ((motion.q, 1.0), (motion.qd, 2 * np.pi * 90), (motion.qdd, (2 * np.pi * 90) ** 2)):
        assert np.max(np.abs(found)) < 2e-3 * size


def test_a_parabola_is_exact():
    t = clock(5.0)
    motion = condition(recording(t, 3.0 - 2.0 * t + 0.7 * t**2), ["joint1"], BAND)
    at = motion.time
    np.testing.assert_allclose(motion.q[:, 0], 3.0 - 2.0 * at + 0.7 * at**2, atol=1e-9)
    np.testing.assert_allclose(motion.qd[:, 0], -2.0 + 1.4 * at, atol=1e-8)
    np.testing.assert_allclose(motion.qdd[:, 0], 1.4, atol=1e-6)


def test_samples_whose_window_leaves_the_recording_are_dropped():
    t = clock()
    motion = condition(recording(t, sine(t, 1.0)[0]), ["joint1"], BAND)
    assert motion.time[0] > t[0]
    assert motion.time[-1] < t[-1]
    assert motion.time[0] - t[0] == pytest.approx(t[-1] - motion.time[-1])
    # Nothing at the edges is worse than in the middle.
    error = np.abs(motion.qdd[:, 0] - sine(motion.time, 1.0)[2])
    assert error[:20].max() < 1e-3 * (2 * np.pi) ** 2
    assert error[-20:].max() < 1e-3 * (2 * np.pi) ** 2


def test_the_band_filter_is_linear_and_treats_every_column_alike():
    t, rng = clock(), np.random.default_rng(0)
    motion = condition(recording(t, sine(t, 1.0)[0]), ["joint1"], BAND)
    columns = rng.normal(size=(len(motion.time), 3))
    x = np.array([2.0, -3.0, 0.5])
    np.testing.assert_allclose(motion.to_band(columns @ x), motion.to_band(columns) @ x, atol=1e-12)
    blocks = motion.to_band(columns.reshape(-1, 3, 1))
    np.testing.assert_array_equal(blocks[:, :, 0], motion.to_band(columns))


@pytest.mark.parametrize("thinning", [2, 3, 7])
def test_the_band_filter_is_one_convolution_at_the_kept_samples(thinning):
    """Its taps are read off the filter itself, from impulses; every length about its own groups of samples is right."""
    t, rng = clock(), np.random.default_rng(0)
    motion = condition(recording(t, sine(t, 1.0)[0]), ["joint1"], BAND)

    def filtered(x):
        return replace(motion, thinning=thinning, segments=(slice(0, len(x)),)).to_band(x)

    taps = filtered(np.eye(8 * thinning + 1))[0]
    np.testing.assert_allclose(taps, taps[::-1], atol=1e-15)
    for n in [*range(1, 8 * thinning + 3), *range(40 * thinning, 60 * thinning), 3000]:
        x = rng.normal(size=n)
        whole = np.convolve(x, taps, mode="valid") if n >= len(taps) else x[:0]
        np.testing.assert_allclose(filtered(x), whole[::thinning], atol=1e-14)


def test_the_band_filter_passes_the_band_and_stops_what_would_alias():
    t = clock()
    motion = condition(recording(t, sine(t, 1.0)[0]), ["joint1"], BAND)
    at = motion.to_band(motion.time)
    assert motion.band == pytest.approx(RATE / (2 * motion.thinning))
    assert 1 / np.median(np.diff(at)) == pytest.approx(2 * motion.band)
    np.testing.assert_allclose(motion.to_band(np.full(len(motion.time), 7.0)), 7.0, rtol=1e-12)
    # Passed to half the band, halved at its edge, stopped where it would fold back to below half the band.
    for part, kept in ((0.1, 1.0), (0.5, 1.0), (1.0, 0.5), (1.6, 0.0), (3.0, 0.0)):
        turn = 2j * np.pi * part * motion.band
        passed = motion.to_band(np.exp(turn * motion.time).view(float).reshape(-1, 2))
        np.testing.assert_allclose(passed @ [1, 1j], kept * np.exp(turn * at), atol=1e-3)


def test_the_band_shrinks_as_encoder_noise_grows():
    t, rng = clock(20.0), np.random.default_rng(2)
    q, noise = sine(t, 1.0)[0], rng.normal(size=round(20 * RATE))
    motions = [condition(recording(t, q + level * noise), ["joint1"]) for level in (0.0, 1e-4, 1e-3, 1e-2)]
    bands = [m.band for m in motions]
    assert bands[0] == pytest.approx(RATE / 6)  # 40 Hz, at a whole number of samples
    assert bands == sorted(bands, reverse=True)
    assert bands[-1] < 0.5 * bands[0]
    noted(motions[-1], "encoder noise")
    # What the band is chosen for: noise in the acceleration stays below a tenth of its signal.
    for motion in motions[:3]:
        error = motion.to_band(motion.qdd[:, 0] - sine(motion.time, 1.0)[2])
        assert np.sqrt(np.mean(error**2)) < 0.1 * (2 * np.pi) ** 2 / np.sqrt(2)


def test_a_joint_that_stands_still_does_not_choose_the_band():
    t, rng = clock(20.0), np.random.default_rng(3)
    q = np.stack([sine(t, 1.0)[0], 1e-3 * rng.normal(size=len(t))], 1)
    motion = condition(recording(t, q, joints=("joint1", "joint2")), ["joint1", "joint2"])
    assert motion.band == pytest.approx(RATE / 6)


@pytest.mark.parametrize("rate", [60.0, 200.0, 1000.0])
def test_the_note_names_the_band_that_is_used(rate):
    t = clock(20.0, rate)
    motion = condition(recording(t, sine(t, 1.0)[0]), ["joint1"])
    assert motion.band <= min(40.0, rate / 2.5)
    noted(motion, f"0 to {motion.band:.3g} Hz")


@pytest.mark.parametrize("band", [0.0, -3.0, 81.0, float("nan"), float("inf")])
def test_a_bandwidth_out_of_range_is_refused(band):
    t = clock()
    with pytest.raises(InputError, match=r"run\.csv: bandwidth .* Hz .*200 samples a second.*<= 80 Hz"):
        condition(recording(t, sine(t, 1.0)[0]), ["joint1"], band)


@pytest.mark.parametrize("kind", ["q", "tau"])
def test_a_joint_without_signal_is_refused(kind):
    t = clock()
    data = recording(t, np.ones((len(t), 2)), joints=("joint1", "joint2")).rename({f"{kind}.joint2": f"{kind}.jiont2"})
    with pytest.raises(InputError) as caught:
        condition(data, ["joint1", "joint2"])
    line = str(caught.value)
    for words in ("run.csv", f"'{kind}.joint2'", f"nearest is '{kind}.jiont2'", "q.joint1", "tau.joint1", "[signals]"):
        assert words in line


@pytest.mark.parametrize("n", [2, 3, 4, 60, 180])
@pytest.mark.parametrize("band", [None, BAND])
def test_too_few_samples_are_refused(n, band):
    t = clock()[:n]
    with pytest.raises(InputError, match=rf"run\.csv: too few samples: {n} rows leave .* at least {MINIMUM_SAMPLES}"):
        condition(recording(t, sine(t, 1.0)[0]), ["joint1"], band)


@pytest.mark.parametrize("band", [None, BAND])
def test_no_run_long_enough_is_refused(band):
    """Two sensors on clocks of their own: each row lacks one or the other."""
    t = clock()
    q, tau = sine(t, 1.0)[0], np.ones(len(t))
    q[::2] = np.nan
    tau[1::2] = np.nan
    with pytest.raises(InputError, match=r"too few samples.*close the gaps"):
        condition(recording(t, q, tau), ["joint1"], band)


def test_a_band_that_only_days_could_fill_is_refused_before_its_filters_are_made():
    """As a recording in seconds asks for beside one in milliseconds: kernels of 10^10 samples."""
    with pytest.raises(InputError, match=r"too few samples.*leave 0 in the 1e-08 Hz analysis band"):
        condition(recording(clock(), sine(clock(), 1.0)[0]), ["joint1"], 1e-8)


def test_temperature_is_kept_and_may_be_missing():
    t = clock()
    data = recording(t, np.stack([sine(t, 1.0)[0]] * 2, 1), joints=("joint1", "joint2"))
    data["temp.joint1"] = ("time", 20.0 + t)
    motion = condition(data, ["joint1", "joint2"], BAND)
    np.testing.assert_allclose(motion.temperature[:, 0], 20.0 + motion.time)
    assert np.all(np.isnan(motion.temperature[:, 1]))


def test_joints_come_in_the_models_order_and_notes_of_the_reader_are_kept():
    t = clock()
    data = recording(t, np.stack([sine(t, 1.0)[0], 0 * t], 1), joints=("a", "b"), notes=["read with care"])
    motion = condition(data, ["b", "a"], BAND)
    assert motion.joints == ("b", "a")
    assert np.ptp(motion.q[:, 0]) == 0.0
    assert np.ptp(motion.q[:, 1]) > 1.9
    noted(motion, "read with care")


def test_the_encoders_noise_is_what_it_leaves_in_the_band():
    """Noise alone, through the same filters, deviates as is predicted from a recording of noise and motion."""
    time = clock(60.0)
    noise = 1e-4 * np.random.default_rng(3).normal(size=len(time))
    forecast = condition(recording(time, sine(time, 0.7)[0] + noise), ["joint1"], BAND).encoder_noise
    alone = condition(recording(time, noise), ["joint1"], BAND)
    for of, x in zip(forecast[:, 0], (alone.q, alone.qd, alone.qdd), strict=True):
        assert of == pytest.approx(np.std(alone.to_band(x)), rel=0.1)


def test_an_encoder_without_noise_has_none():
    time = clock(60.0)
    noise = condition(recording(time, sine(time, 0.7)[0]), ["joint1"], BAND).encoder_noise
    assert noise[2, 0] < 1e-6


def test_what_is_only_followed_may_be_short():
    t = clock()[:80]
    motion = condition(recording(t, sine(t, 1.0)[0]), ["joint1"], BAND, fitted=False)
    np.testing.assert_allclose(motion.qd[:, 0], sine(motion.time, 1.0)[1], atol=1e-2)
    with pytest.raises(InputError, match="too few samples"):
        condition(recording(t[:8], sine(t[:8], 1.0)[0]), ["joint1"], BAND, fitted=False)


def test_a_short_recording_from_coarse_encoders_keeps_enough_of_its_band():
    """In the band that its noise asks for, 2 Hz, 12 s at 100 Hz would be 33 samples."""
    t = clock(12.0, 100.0)
    step = 2e-2
    q = 0.3 * np.sin(2 * np.pi * 0.2 * t) + 0.2 * step * np.random.default_rng(0).normal(size=len(t))
    motion = condition(recording(t, step * np.round(q / step)), ["joint1"])
    assert LEAST_KEPT / 2 < len(motion.to_band(motion.tau)) <= LEAST_KEPT
    assert motion.band == pytest.approx(LEAST_KEPT / 24.0, rel=0.01)
    noted(motion, "encoder noise is high")
