"""Motion that was asked for: the band where a disturbance takes over, and the low-pass that keeps to it."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest
from moving_arm import exact

from snarelab.identification.fitting.assembly import Block
from snarelab.identification.fitting.experiment import Experiment
from snarelab.identification.search import closed_loop
from snarelab.identification.search.closed_loop import _bands, _directed, _low_passed, planned

PERIOD, N = 0.01, 8000
TIME = PERIOD * np.arange(N)
EDGE = 50.0


def run(q, qd, qdd, segments=None) -> Any:
    t = PERIOD * np.arange(len(q))
    samples = (t, *(np.array(x, order="F") for x in (q, qd, qdd)), np.zeros(q.shape))
    motion = exact(tuple(f"joint{k + 1}" for k in range(q.shape[1])), PERIOD, 1, samples, segments)
    none: Any = None
    return Experiment(motion, none)


def sine(hertz, n=2000, n_joints=1):
    wave = np.sin(2 * np.pi * hertz * PERIOD * np.arange(n))
    return np.stack(n_joints * [wave], 1)


@pytest.mark.parametrize(("hertz", "band"), [(5.0, 5.0), (2.5, 5.0), (7.0, 5.0), (5.0, 10.0)])
def test_the_low_pass_is_butterworths_of_fourth_order_passed_both_ways(hertz, band):
    """Gain 1 / (1 + r^8), r = tan(pi f T) / tan(pi band T), without a lag; half at the band's edge."""
    ratio = np.tan(np.pi * hertz * PERIOD) / np.tan(np.pi * band * PERIOD)
    wave = sine(hertz, n_joints=2)
    e = run(wave, 2 * wave, 3 * wave)
    made = _low_passed(e, np.array([band, np.inf]))
    inner = slice(800, 1200)
    for name, size in (("q", 1.0), ("qd", 2.0), ("qdd", 3.0)):
        filtered = getattr(made.motion, name)
        np.testing.assert_allclose(filtered[inner, 0], size / (1 + ratio**8) * wave[inner, 0], atol=1e-3)
        np.testing.assert_array_equal(filtered[:, 1], size * wave[:, 1])  # no filter asked for
        np.testing.assert_array_equal(getattr(e.motion, name), size * wave)  # the recording stays what it was
    (note,) = made.motion.notes
    assert note.endswith(f"drive these joints above: joint1 {band:g} Hz")
    np.testing.assert_array_equal(made.store["bands"], [band, np.inf])


def test_a_gap_is_not_filtered_across():
    """Zeros before and ones after it: a low-pass leaves either alone, and would round the step between them."""
    x = np.repeat([0.0, 1.0], 500)[:, None]
    made = _low_passed(run(x, x, x, (slice(0, 500), slice(500, 1000))), np.array([3.0]))
    np.testing.assert_allclose(made.motion.q, x, atol=1e-9)


def test_direction_and_speed_without_it():
    """Over half a percent of the peak, here 0.01: tanh(1) and tanh(-3) of the way near rest."""
    speed = np.array([2.0, -2.0, 0.01, -0.03, 0.0])
    qd = np.stack([np.zeros(5), speed], 1)
    found = _directed(run(qd, qd, qd), 1)
    np.testing.assert_allclose(found[:, 0], [1.0, -1.0, np.tanh(1.0), -np.tanh(3.0), 0.0], rtol=1e-12)
    np.testing.assert_allclose(found[:, 1], [2.0, 2.0, 0.01 * np.tanh(1.0), 0.03 * np.tanh(3.0), 0.0], rtol=1e-12)
    assert not _directed(run(qd, qd, qd), 0).any()


def disturbed(
    level=0.1 / 8, edge=8.0, inertia=1.0, slow=1.0, seed=0, segments=None, rest=False, column=None, extra=0.0
):
    """One joint: speed a sine of ``slow`` Hz, acceleration white up to ``edge`` Hz, residual white throughout.

    ``level`` is the residual's density over the acceleration's. Returns the experiment, and what the fit leaves of it.
    """
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft(rng.normal(size=N))
    spectrum[np.fft.rfftfreq(N, PERIOD) > edge] = 0.0
    acceleration = np.fft.irfft(spectrum, N)[:, None]
    speed = 5.0 * np.sin(2 * np.pi * slow * TIME)[:, None]
    residual = np.sqrt(level) * rng.normal(size=(N, 1))
    if rest:
        residual = np.where(np.abs(speed) <= 0.02 * np.abs(speed).max(), 20.0 * residual, 0.0)
    if column is not None:
        residual = residual + extra * column
    whole = run(np.cumsum(speed, axis=0) * PERIOD, speed, acceleration, segments)
    mass = np.full((N, 1, 1), inertia)
    e: Any = Made(
        motion=whole.motion, measured=residual, mass_matrix=mass, elapsed=TIME, to_band=lambda x, _c: x, store={}
    )
    return e, residual


def bands(*several, blocks=(), share=0.1):
    residuals = {id(e): r for e, r in several}
    assembly = Made(
        residual=lambda e, _theta: (residuals[id(e)], list(blocks)),
        evaluate=lambda e, _theta: Made(load=np.zeros((N, 1))),
        tree=Made(carriers=0),
    )
    found: Any = Made(assembly=assembly, theta=None)
    return _bands(found, [e for e, _ in several], share)


def test_a_clock_of_ten_seconds_has_a_band_too(monkeypatch):
    """As where milliseconds are read as seconds: eight seconds, the usual window, hold no sample."""
    monkeypatch.setitem(globals(), "PERIOD", 10.0)
    monkeypatch.setitem(globals(), "TIME", 10.0 * np.arange(N))
    (band,) = bands(disturbed(0.1 / 8, edge=8e-3, slow=1e-3))
    assert 8e-3 <= band < 0.05


@pytest.mark.parametrize(
    ("level", "inertia", "wanted"),
    [
        # The share up to f is level / inertia² · f³ of the edge's 8³: a tenth at 8 · (0.1 inertia² / level)^(1/3).
        (0.1 / 8, 1.0, 16.0),
        (0.1 / 8, 2.0, 8.0 * (8 * 4) ** (1 / 3)),
        (0.1 / 3, 1.0, 8.0 * 3 ** (1 / 3)),
        (0.1 / 6000, 1.0, np.inf),  # beyond nine tenths of the analysis band's 50 Hz
    ],
)
def test_the_band_ends_where_what_is_unexplained_drives_a_tenth_of_the_jerk(level, inertia, wanted):
    (found,) = bands(disturbed(level, inertia=inertia))
    assert found == pytest.approx(wanted, rel=0.06)


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_half_the_share_that_may_be_driven_is_a_cube_roots_less_of_the_band(share):
    (found,) = bands(disturbed(), share=share)
    assert found == pytest.approx(16.0 * (share / 0.1) ** (1 / 3), rel=0.06)
    assert abs(found - 16.0) > 1.0


def test_the_band_is_four_times_the_speeds_own_at_least():
    """Speed at 5 Hz: 20 Hz, to the eighth of a hertz that the spectrum tells (and the window's width)."""
    (found,) = bands(disturbed(slow=5.0))
    assert found == pytest.approx(20.0, abs=1.0)
    (found,) = bands(disturbed(slow=3.0))
    assert found == pytest.approx(16.0, rel=0.06)  # 12 Hz would be less


def test_of_several_recordings_the_narrowest_band_counts_and_of_one_its_longest_run():
    found = bands(disturbed(0.1 / 400, seed=1), disturbed(seed=2), disturbed(0.1 / 400, seed=3))
    assert found == pytest.approx([16.0], rel=0.06)
    for edge, short in ((2000, slice(0, 2000)), (6000, slice(6000, N))):
        e, residual = disturbed(segments=(slice(0, edge), slice(edge, N)))
        residual[short] *= 5.0
        assert bands((e, residual)) == pytest.approx([16.0], rel=0.08)


def test_what_sticks_near_rest_is_no_disturbance():
    assert bands(disturbed(rest=True)) == pytest.approx([np.inf])


def test_what_the_models_own_columns_explain_is_no_disturbance():
    """A third of the samples apart, loud: without the column the band would end much earlier."""
    column = np.random.default_rng(9).normal(size=(N, 1))
    loud = disturbed(column=column, extra=1.0)
    block = Block(0, np.array([0]), column)
    assert bands(loud, blocks=[block]) == pytest.approx([16.0], rel=0.06)
    assert bands(loud)[0] < 8.0


def planned_with(monkeypatch, found, before=None, n=1):
    """`planned` with bands given; what is filtered is told by its note."""
    monkeypatch.setattr(closed_loop, "_bands", lambda *_: np.array(found))
    wave = sine(1.0, 200, len(found))
    experiments = [run(wave, wave, wave) for _ in range(n)]
    earlier = None
    if before is not None:
        earlier = [run(wave, wave, wave)]
        if before:
            earlier[0].store["bands"] = np.array(before)
    fit: Any = None
    return planned(fit, experiments, earlier, driven=0.1), experiments, earlier


def test_where_no_band_is_narrower_than_the_analysis_nothing_is_filtered(monkeypatch):
    made, given, _ = planned_with(monkeypatch, [EDGE, np.inf], n=2)
    assert all(a is b for a, b in zip(made, given, strict=True))
    made, given, _ = planned_with(monkeypatch, [EDGE - 10.0, np.inf], n=2)
    assert [len(e.motion.notes) for e in made] == [1, 1]
    assert [len(e.motion.notes) for e in given] == [0, 0]


@pytest.mark.parametrize(
    ("before", "now", "kept"),
    [
        ([10.0, np.inf], [12.8, 80.0], True),  # the logarithm of 1.28 is 0.247; beyond the edge all is one
        ([10.0, np.inf], [12.9, np.inf], False),
        ([12.9, np.inf], [10.0, np.inf], False),  # narrower by as much
        ([10.0, 20.0], [10.0, 30.0], False),  # one joint is enough
        ([], [45.0, np.inf], True),  # nothing was filtered: as good as the edge, 50 Hz
        ([], [30.0, np.inf], False),
    ],
)
def test_an_earlier_answer_stays_where_bands_have_hardly_changed(monkeypatch, before, now, kept):
    made, _, earlier = planned_with(monkeypatch, now, before)
    assert earlier is not None
    assert (made[0] is earlier[0]) is kept
    if not kept:
        np.testing.assert_array_equal(made[0].store["bands"], now)
