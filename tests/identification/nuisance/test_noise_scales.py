"""Scales of the noise learnt on data in which one nuisance alone is present, drawn by its own recipe."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag, cholesky, toeplitz
from scipy.signal import butter, sosfilt
from scipy.stats import multivariate_normal

from snarelab.identification.nuisance.learn import learn
from snarelab.identification.nuisance.likelihood import Cost
from snarelab.identification.nuisance.noise import Noise, NoiseChannel

STEP, N = 1 / 80, 1600
TIME = STEP * np.arange(N)


def run(encoder=0.0, sticks=None, settles=None, level=0.0, n=N) -> NoiseChannel:
    nothing = np.zeros(n)
    return NoiseChannel(
        STEP,
        (slice(0, n),),
        np.full(n, encoder),
        (nothing if sticks is None else sticks,),
        nothing if settles is None else settles,
        level,
    )


def columns(n=N):
    """What could explain a residual: two slow waves and a trend, of unit RMS."""
    t = STEP * np.arange(n)
    x = np.stack([np.sin(2 * np.pi * 0.21 * t), np.cos(2 * np.pi * 0.34 * t), t - t.mean()], 1)
    return x / np.sqrt(np.mean(x**2, axis=0))


def process(rng, level, time, n=N):
    """Drawn with the dense covariance's root."""
    return cholesky(level**2 * toeplitz(np.exp(-STEP * np.arange(n) / time)) + 1e-12 * np.eye(n), lower=True) @ (
        rng.normal(size=n)
    )


def learnt(residual, own: NoiseChannel) -> Noise:
    return learn([residual], [columns(len(residual))], [own])


@pytest.mark.parametrize("seed", range(3))
def test_white_noise_is_white(seed):
    found = learnt(0.7 * np.random.default_rng(seed).normal(size=N), run())
    assert np.hypot(found.white, found.coloured) == pytest.approx(0.7, rel=0.1)
    assert found.coloured < 0.5 * found.white or found.coloured_time < 2 * STEP
    assert found.wander < 0.1


@pytest.mark.parametrize("seed", range(3))
def test_coloured_noise_has_its_level_and_its_time(seed):
    rng = np.random.default_rng(10 + seed)
    found = learnt(process(rng, 0.7, 0.1) + 0.1 * rng.normal(size=N), run())
    # What tells, sample by sample, is the rate of its news; level and time go together where little is slower.
    assert found.coloured**2 / found.coloured_time == pytest.approx(0.7**2 / 0.1, rel=0.25)
    assert 0.5 < found.coloured < 1.0
    assert 0.05 < found.coloured_time < 0.25
    assert found.white < 0.25
    assert found.wander < 0.2


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("edge", [0.5, 1.0, 2.5])
def test_noise_below_an_edge_is_smooth(seed, edge):
    """White noise below a Butterworth edge, as of structures and of what a servo lets through: no lag of first order
    has its spectrum, and what would be left of it is none of the physics'."""
    rng = np.random.default_rng(15 + seed)
    drawn = np.asarray(sosfilt(butter(2, edge, fs=1 / STEP, output="sos"), rng.normal(size=N + 800)))[800:]
    residual = 0.5 * drawn / np.std(drawn) + 0.01 * rng.normal(size=N)
    found = learnt(residual, run())
    assert found.order == 2
    assert found.wander == 0.0
    assert found.coloured == pytest.approx(0.5, rel=0.4)
    white = found.covariance(run()).white(residual[:, None])
    assert np.mean(white**2) == pytest.approx(1.0, rel=0.3)


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_first_order_is_not_smooth(seed):
    rng = np.random.default_rng(10 + seed)
    assert learnt(process(rng, 0.7, 0.1) + 0.1 * rng.normal(size=N), run()).order == 1


def test_that_noise_is_smooth_has_the_prior_odds_of_nameless_physics():
    rough = Noise(0.1, 0.2, 0.1, 0.0, 2.0, 0.0, odds=0.05)
    assert rough.log_prior == 0.0
    assert replace(rough, order=2).log_prior == pytest.approx(np.log(0.05))
    wanders = replace(rough, wander=0.3)
    assert replace(wanders, order=2).log_prior == pytest.approx(wanders.log_prior + np.log(0.05))


def test_what_too_few_samples_cannot_tell_is_of_first_order():
    """Of first order, 100 samples; with even odds 13 of 30 are called smooth."""
    own, smooth = run(n=100), 0
    for seed in range(30):
        rng = np.random.default_rng(40 + seed)
        residual = process(rng, 0.7, 0.1)[:100] + 0.1 * rng.normal(size=100)
        smooth += learnt(residual, own).order == 2
    assert smooth <= 3


@pytest.mark.parametrize("seed", range(3))
def test_a_level_that_wanders_is_found_beside_what_it_could_be_taken_for(seed):
    """As loud as all else and over 8 s, in 40 s: the level of the few stretches that there are scatters by a third."""
    rng = np.random.default_rng(20 + seed)
    n = 2 * N
    drawn: np.ndarray = process(rng, 0.7, 8.0, n)
    found = learnt(drawn + 0.3 * rng.normal(size=n), run(n=n))
    assert 0.3 < found.wander < 2.0
    assert found.white == pytest.approx(0.3, rel=0.3)


def test_channels_share_the_odds_that_something_wanders():
    """A weak wander is believed of one channel that there is, and not of one in many."""
    rng = np.random.default_rng(31)
    n = 2 * N
    drawn: np.ndarray = process(rng, 0.06, 8.0, n)
    residual = drawn + 0.4 * rng.normal(size=n)
    told = [learn([residual], [columns(n)], [run(n=n)], channels=x) for x in (1, 4, 10**12)]
    assert told[0].wander > 0
    assert told[2].wander == 0
    one, four = (replace(told[0], odds=x.odds).log_prior for x in told[:2])
    assert one - four == pytest.approx(np.log(4), rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_a_level_that_may_wander_only_late_is_found_there_and_nothing_is_excused_before(seed):
    """A pull that keeps an unknown share of its load once its seat slid: known to a millinewton before."""
    rng = np.random.default_rng(60 + seed)
    n = 2 * N
    late = (np.arange(n) >= N).astype(float)
    residual = late * process(rng, 0.7, 8.0, n) + 0.03 * rng.normal(size=n)
    own = replace(run(n=n), wanders=late)
    found = learnt(residual, own)
    assert 0.2 < found.wander < 2.0
    noise = found.covariance(own)
    size = [1 / np.sqrt(float(k @ noise.solve(k))) for k in (1 - late, late)]
    assert size[0] < 0.01, "a shift before"
    assert size[1] > 0.1, "a shift after"


@pytest.mark.parametrize("seed", range(3))
def test_encoder_noise_is_known_and_leaves_nothing_for_the_rest(seed):
    rng = np.random.default_rng(30 + seed)
    noise = np.diff(rng.normal(size=N + 2), 2) * 0.7 / np.sqrt(6)
    known, unknown = learnt(noise, run(encoder=0.7)), learnt(noise, run())
    assert known.white < 0.15
    assert known.coloured < 0.15
    assert unknown.white > 0.5  # not told of it, the noise must be white


def test_sticking_stays_out_of_what_is_learnt_in_motion():
    """A joint that holds up to 5 in a tenth of the samples: known to stick there, its noise in motion is 0.3."""
    rng = np.random.default_rng(40)
    sticks = np.zeros(N)
    for start in range(50, N, 160):
        sticks[start : start + 16] = 1.0
    residual = 0.3 * rng.normal(size=N) + 5 * rng.uniform(-1, 1, N) * sticks
    told, untold = learnt(residual, run(sticks=sticks, level=5.0)), learnt(residual, run())
    assert np.hypot(told.white, told.coloured) == pytest.approx(0.3, rel=0.1)
    assert np.hypot(untold.white, untold.coloured) > 0.7


def test_where_friction_settles_its_level_is_learnt():
    rng = np.random.default_rng(41)
    settles = (np.arange(N) // 20 % 5 == 0).astype(float)
    residual = (0.2 + 1.0 * settles) * rng.normal(size=N)
    found = learnt(residual, run(settles=settles))
    assert found.settling == pytest.approx(np.sqrt(1.2**2 - 0.2**2), rel=0.2)
    assert np.hypot(found.white, found.coloured) == pytest.approx(0.2, rel=0.2)


@pytest.mark.parametrize("column", [0, 2], ids=["wave", "drift"])
@pytest.mark.parametrize("times", [10, 100])
def test_physics_that_could_explain_it_is_not_taken_for_noise(times, column):
    """A wave or a drift that one of the columns makes, 10 or 100 times the noise of 0.3: the noise stays white."""
    rng = np.random.default_rng(42)
    residual = 0.3 * times * columns()[:, column] + 0.3 * rng.normal(size=N)
    found = learnt(residual, run())
    assert np.hypot(found.white, found.coloured) == pytest.approx(0.3, rel=0.1)
    assert found.coloured < 0.5 * found.white
    assert found.wander == 0.0


def test_the_likelihood_is_that_of_all_samples_with_the_amplitudes_integrated_out():
    rng, n = np.random.default_rng(43), 60
    own = run(n=n)
    noise, spread = Noise(0.9, 0.4, 0.1, 0.3, 8.0, 0.0), 0.7
    x = [rng.normal(size=(n, 3)) for _ in range(2)]
    r = [rng.normal(size=n) + c @ np.ones(3) for c in x]
    cost = Cost([(np.column_stack([a, b]), own) for a, b in zip(r, x, strict=True)])
    # A noise that comes again with another spread is remembered; another noise is not taken for it.
    for asked, wide in ((noise, spread), (noise, 0.2), (replace(noise, white=1.1), 0.2), (noise, spread)):
        k: Any = (
            np.asarray(block_diag(*[asked.covariance(own).dense()] * 2), float)
            + wide**2 * np.concatenate(x) @ np.concatenate(x).T
        )
        wanted = -multivariate_normal(np.zeros(2 * n), k).logpdf(np.concatenate(r)) - n * np.log(2 * np.pi)
        assert cost(asked, wide) == pytest.approx(wanted, rel=1e-9)
