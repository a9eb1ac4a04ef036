"""The encoders' search, part by part: grids, blocks, curves, what is foreseen and what is held against chance."""

from itertools import pairwise

import numpy as np
import pytest
from encoder_pairs import RATE, pair, placed, run

from snarelab.identification.links import search
from snarelab.identification.links.pair import PairFit, fit_pair
from snarelab.identification.links.search import library, search_pair
from snarelab.identification.search.noise import Whitener

N = 256
TIME = np.arange(N) / RATE
WAVE = np.sin(3 * TIME)
GAIN, DRIFT = placed("sensor_gain", "q_link.joint1"), placed("sensor_drift", "q_link.joint1")
PLAIN = Whitener(np.zeros(0), 1.0, 0)
"""Leaves samples as they are."""


def test_six_effects_can_make_two_encoders_differ():
    assert [p.key for p in library(pair())] == [
        "sensor_delay.q.joint1",
        "sensor_delay.q_link.joint1",
        "sensor_gain.q_link.joint1",
        "sensor_drift.q_link.joint1",
        "joint_elasticity.joint1",
        "backlash.joint1",
    ]


def test_a_grid_is_in_the_joints_scales_and_an_amplitude_starts_where_it_vanishes(monkeypatch):
    """Peak torque 8 over travel 0.5 is 16."""
    springs = search.starts(pair(), placed("joint_elasticity", "joint1"))
    wanted = [(k * 16, d * 16) for k in (10, 30, 100, 300, 1000, 3000) for d in (0.01, 0.1, 1.0)]
    np.testing.assert_allclose(springs, wanted)
    plays = search.starts(pair(), placed("backlash", "joint1"))
    assert [p[2] for p in plays[:5]] == pytest.approx([g * 0.5 for g in (3e-4, 1e-3, 3e-3, 0.01, 0.03)])
    assert len(plays) == 10
    assert [s.tolist() for s in search.starts(pair(), GAIN)] == [[0.0]]
    # Of 18 points 7 at most: every third.
    for most, step in ((7, 3), (18, 1), (17, 2), (9, 2)):
        monkeypatch.setattr(search, "MOST_VARIANTS", most)
        np.testing.assert_allclose(search.starts(pair(), placed("joint_elasticity", "joint1")), wanted[::step])


def segmented(*sizes):
    """A pair of one recording with segments of these sizes; 10 samples a second in the analysis band."""
    n = sum(sizes)
    edges = np.cumsum([0, *sizes])
    parts = [slice(int(a), int(b)) for a, b in pairwise(edges)]
    return pair(run(np.zeros(n), np.zeros(n), segments=parts, rate=10.0))


@pytest.mark.parametrize(
    ("sizes", "lead", "wanted"),
    [
        ((162,), 12, list(range(0, 151, 15))),  # 150 samples in ten blocks of 1.5 s
        (
            (162, 12, 5, 45),
            12,
            [*range(0, 151, 25), 166, 183],
        ),  # 6 each of four; what is no longer than the lead has none
        ((17,), 12, [0, 2, 5]),  # two at least
        ((13,), 12, [0, 1]),  # of one sample only one
        ((720,), 0, list(range(0, 721, 30))),  # 24 at most
        ((720, 720), 0, list(range(0, 1441, 60))),  # 12 each of two
        ((120,) * 7, 0, list(range(0, 841, 30))),  # 4 each, however many there are
        ((44,), 0, [0, 22, 44]),  # 2.9 blocks' time makes two
        ((45,), 0, [0, 15, 30, 45]),
    ],
)
def test_blocks_last_a_second_and_a_half_and_are_not_too_many(sizes, lead, wanted):
    found = search.blocks(segmented(*sizes), lead)
    assert [(b.start, b.stop) for b in found] == list(pairwise(wanted))


def test_a_blocks_energy_is_half_its_squared_residual():
    fit = PairFit((), np.zeros(0), np.array([3.0, 4.0, 1.0, -2.0]), np.zeros((4, 0)))
    assert search.block_energies(fit, [slice(0, 2), slice(2, 3), slice(3, 4)]).tolist() == [12.5, 0.5, 2.0]


@pytest.mark.parametrize("scale", [1.0, 1e-5])
def test_a_blocks_fresh_energy_is_that_of_a_regression_on_the_others(scale):
    """The block's residual after a correction that the other blocks ask for, by NumPy."""
    rng = np.random.default_rng(2)
    jacobian, residual = rng.normal(size=(40, 3)) * [1.0, scale, 10.0], rng.normal(size=40)
    parts = [slice(0, 12), slice(12, 13), slice(13, 40)]
    wanted = []
    for b in parts:
        rest = np.r_[0 : b.start, b.stop : 40]
        step = np.linalg.lstsq(jacobian[rest], residual[rest], rcond=None)[0]
        wanted.append(0.5 * np.sum((residual[b] - jacobian[b] @ step) ** 2))
    found = search.fresh_energies(PairFit((), np.zeros(3), residual, jacobian), parts)
    np.testing.assert_allclose(found, wanted, rtol=1e-8)


def test_what_only_one_block_knows_is_left_as_it_is_there():
    """A column that is zero outside the block: the others ask for no step along it."""
    jacobian, residual = np.zeros((4, 1)), np.array([1.0, 2.0, 3.0, 4.0])
    jacobian[2:] = 1.0
    fresh = search.fresh_energies(PairFit((), np.zeros(1), residual, jacobian), [slice(2, 4)])
    assert fresh == pytest.approx([12.5])


def test_smooth_curves_are_hats_over_position_speed_load_and_time_of_all_recordings():
    """Fifteen samples over seven steps between eight knots: every other stands on a knot, the others halfway."""
    steps = np.arange(15.0)
    q = np.r_[steps[::2], steps[13::-2]]
    one = run(q, 0 * q, load=-steps, qd=10 - steps, rate=1.0, start=7.0)
    between = np.zeros((15, 8))
    for i in range(15):
        between[i, i // 2] += 0.5
        between[i, (i + 1) // 2] += 0.5
    hats = search.smooth(pair(one))
    assert hats.shape == (15, 32)
    order = (q / 1).astype(int)
    np.testing.assert_allclose(hats[:, :8], between[order], atol=1e-12)
    for start in (8, 16):  # speed and load fall where time rises
        np.testing.assert_allclose(hats[:, start : start + 8], between[::-1], atol=1e-12)
    np.testing.assert_allclose(hats[:, 24:], between, atol=1e-12)


def test_what_does_not_change_has_no_curve_and_two_recordings_share_their_knots():
    """The first recording is at rest at 0, the other goes from 0 to 14, and half as long as the first lasts."""
    one, other = (
        run(np.zeros(29), np.zeros(29), rate=1.0),
        run(np.arange(15.0), np.zeros(15), qd=np.zeros(15), rate=1.0),
    )
    hats = search.smooth(pair(one, other))
    assert hats.shape == (44, 16)  # position and time
    np.testing.assert_allclose(hats[:29, :8], np.tile(np.eye(8)[0], (29, 1)))
    np.testing.assert_allclose(hats[29 + 4, :8], np.eye(8)[2], atol=1e-12)
    np.testing.assert_allclose(hats[29 + 4, 8:], np.eye(8)[1], atol=1e-12)
    np.testing.assert_allclose(hats[:, 8:].sum(1), 1.0)


def noisy(*terms, sigma=1e-3, n=N, load=None, seed=1, q=None):
    """A pair whose encoders differ by the terms and white noise."""
    q = np.sin(3 * np.arange(n) / RATE) if q is None else q
    noise = sigma * np.random.default_rng(seed).normal(size=n)
    return pair(run(q, sum(terms, noise), load=load))


@pytest.mark.parametrize(
    ("candidate", "start"),
    [
        (GAIN, [0.0]),
        (placed("sensor_delay", "q_link.joint1"), [0.02]),
        (placed("joint_elasticity", "joint1"), [900, 9]),
    ],
)
@pytest.mark.parametrize("noise", [PLAIN, Whitener(np.array([0.5]), 0.01, 3)])
def test_the_gain_foreseen_is_what_a_regression_beside_the_model_gains(candidate, start, noise):
    one = noisy(0.02 * WAVE, -0.01 * TIME, load=5 * np.cos(7 * TIME))
    white = fit_pair(one, [DRIFT], np.zeros(2), noise)
    value, slopes = one.runs[0].term(candidate, np.array(start, float))
    value, slopes = (noise(x, one.segments) for x in (value, slopes))
    rest, columns = white.residual - value, np.hstack([white.jacobian, slopes])
    left = rest - columns @ np.linalg.lstsq(columns, rest, rcond=None)[0]
    found = search._foreseen(one, candidate, np.array(start, float), white, noise)
    assert found == pytest.approx(0.5 * (np.sum(white.residual**2) - np.sum(left**2)), rel=1e-6)


@pytest.mark.parametrize(
    ("fresh", "holds"),
    [
        ([1.0] * 12, True),
        ([9.0] * 4 + [0.0] * 8, True),  # a draw misses four of twelve in (8/12)^12 = 0.8 % of all cases
        ([9.0] * 2 + [0.0] * 10, False),  # two in 11 %
        ([9.0] + [-0.5] * 11, False),
        ([0.0] * 12, False),
        ([-1.0] * 12, False),
        ([0.5] * 11 + [-0.5], True),  # takes six draws of the one
        ([0.5] * 11 + [-2.0], False),  # three draws, in 7 %
    ],
)
def test_a_gain_holds_if_hardly_any_draw_of_blocks_loses_it(fresh, holds):
    assert search._holds(np.array(fresh)) is holds


def tried(one, candidate, noise, bar=5.0, given=()):
    found = fit_pair(one, given, np.zeros(len(given) + len(one.runs)))
    white = fit_pair(one, given, found.theta, noise)
    return search._trial(one, candidate, found, white, noise, bar), found, white


def test_a_trial_is_scored_by_the_gain_less_half_the_logarithm_of_the_samples():
    """Drift beside a gain that is there already, in noise of one: gains and shares from regressions by NumPy."""
    n = 640
    t = np.arange(n) / RATE
    one = noisy(2.0 * np.sin(3 * t), 0.3 * t, sigma=1.0, n=n)
    trial, found, white = tried(one, DRIFT, PLAIN, given=(GAIN,))
    y, few = one.runs[0].measured, np.stack([np.sin(3 * t), np.ones(n)], 1)
    many = np.column_stack([few, t])
    before, after = (y - a @ np.linalg.lstsq(a, y, rcond=None)[0] for a in (few, many))
    gain = 0.5 * (before @ before - after @ after)
    assert gain > 20
    assert trial.price == pytest.approx(0.5 * np.log(n))
    assert trial.gains.sum() == pytest.approx(gain, rel=1e-8)
    assert len(trial.gains) == 6  # 10 s in blocks of 1.5 s
    assert trial.score == pytest.approx(gain - 0.5 * np.log(n), rel=1e-8)
    assert trial.explained == pytest.approx(1 - (after @ after) / (before @ before), rel=1e-8)
    assert trial.passes
    assert trial.fit.placed == (GAIN, DRIFT)
    np.testing.assert_allclose(trial.fit.theta, np.linalg.lstsq(many, y, rcond=None)[0][[0, 2, 1]], rtol=1e-3)
    # The score must exceed the bar, here by a hair.
    for bar, passes in ((trial.score - 1e-6, True), (trial.score + 1e-6, False)):
        assert search._trial(one, DRIFT, found, white, PLAIN, bar).passes is passes


@pytest.mark.parametrize(("size", "passes"), [(0.35, True), (0.2, False)])
def test_an_effect_that_explains_less_than_a_twentieth_is_not_worth_a_name(size, passes):
    """A gain of a sine of unit mean square beside noise of one: size² / (1 + size²), 11 % or 4 %, of 4096 samples."""
    n = 4096
    sine = np.sqrt(2) * np.sin(3 * np.arange(n) / RATE)
    trial, _, _ = tried(noisy(size * sine, sigma=1.0, n=n, q=sine), GAIN, PLAIN)
    assert trial.score > 20
    assert trial.explained == pytest.approx(size**2 / (1 + size**2), abs=0.02)
    assert trial.passes is passes


def test_what_cannot_pass_with_every_slope_free_is_not_fitted(monkeypatch):
    one = noisy(sigma=1.0)
    found = white = fit_pair(one, [], np.zeros(1))
    monkeypatch.setattr(search, "fit_pair", None)
    trial = search._trial(one, DRIFT, found, white, PLAIN, 5.0)
    n, y = N, white.residual
    slope = TIME - TIME.mean()
    gain = 0.5 * (y @ slope) ** 2 / (slope @ slope)
    assert trial.score == pytest.approx(gain - 0.5 * np.log(n), rel=1e-8)
    assert trial.score < 5.0
    assert (trial.fit, trial.explained, trial.passes, trial.price) == (white, 0.0, False, 0.5 * np.log(n))
    assert trial.gains.tolist() == [0.0, 0.0]  # 4 s in two blocks


def test_a_damping_without_influence_costs_nothing():
    """A spring under slow load: 0.8 mrad of twist in noise of 10 µrad, a damper that acts three hundred times less."""
    n = 640
    t = np.arange(n) / RATE
    load = 8 * np.sin(0.5 * t)
    trial, _, _ = tried(noisy(-load / 1e4, sigma=1e-5, n=n, load=load), placed("joint_elasticity", "joint1"),
                        Whitener(np.zeros(0), 1e-5, 0))  # fmt: skip
    assert trial.passes
    assert trial.fit.theta[0] == pytest.approx(1e4, rel=0.01)
    assert trial.price == pytest.approx(0.5 * np.log(n))


def test_the_search_names_what_is_there_and_stops():
    """Gain and drift in white noise. The bar: six candidates, three joints, once in 200 diagnoses."""
    n = 640
    t = np.arange(n) / RATE
    one = noisy(0.02 * np.sin(3 * t), -0.01 * t, 0.5 + 0 * t, n=n, load=8 * np.cos(3 * t))
    searched = search_pair(one, [], np.zeros(0), 3)
    assert searched.bar == pytest.approx(np.log(6 * 3 * 200))
    assert {m.trial.placed.key for m in searched.named} == {GAIN.key, DRIFT.key}
    assert [t.placed.key for t in searched.opening] == [p.key for p in library(one)]
    assert searched.first.placed == ()
    found = searched.fit.theta[[searched.fit.parameters(p).start for p in (GAIN, DRIFT)]]
    np.testing.assert_allclose(found, [0.02, -0.01], atol=3e-4)
    np.testing.assert_allclose(searched.fit.zeros, [0.5], atol=1e-3)
    assert searched.whiten.sigma == pytest.approx(1e-3, rel=0.1)


def test_the_noise_is_learnt_from_what_every_candidate_and_curve_together_leave(monkeypatch):
    """Columns: the fit's own, each candidate's value and slopes in the middle of its grid, and the curves."""
    seen = []
    monkeypatch.setattr(search, "whitener", lambda *given: seen.append(given) or ("found", None))
    t = np.arange(N) / RATE
    both = pair(run(np.sin(3 * t), 0.1 * t, load=np.cos(t)), run(np.cos(2 * t), 0.2 * t, load=np.sin(t)))
    first = fit_pair(both, [], np.zeros(2))
    late = placed("sensor_delay", "q_link.joint1")
    assert search._noise(both, first, [GAIN, late]) == "found"
    ((residual, columns, segments),) = seen
    assert residual is first.residual
    assert segments == (slice(0, N), slice(N, 2 * N))
    q = np.r_[np.sin(3 * t), np.cos(2 * t)]
    np.testing.assert_allclose(columns[:, :2], np.repeat(np.eye(2), N, axis=0))
    np.testing.assert_allclose(columns[:, 2:4], np.stack([0 * q, q], 1), atol=1e-12)
    # The fifth of eight delays is 5 ms; straight lines between samples are within (3 / 64)² / 8 of a wave.
    delayed = np.r_[np.sin(3 * (t - 0.005)) - np.sin(3 * t), np.cos(2 * (t - 0.005)) - np.cos(2 * t)]
    late_rows = np.r_[20:N, N + 20 : 2 * N]
    np.testing.assert_allclose(columns[late_rows, 4], delayed[late_rows], atol=2e-4)
    np.testing.assert_allclose(columns[:, 6:], search.smooth(both))


def test_a_trial_starts_from_the_best_of_its_grid_and_ends_between_its_points():
    """A delay of 13.7 ms, between grid points of 10 and 20 ms, of a wave that has one in closed form."""
    n = 640
    t = np.arange(n) / RATE

    def q(t):
        return np.sin(3 * t) + 0.3 * np.sin(11 * t)

    one = noisy(q(t - 0.0137) - q(t), sigma=1e-4, n=n, q=q(t))
    noise = Whitener(np.zeros(0), 1e-4, 12)
    trial, _, _ = tried(one, placed("sensor_delay", "q_link.joint1"), noise)
    assert trial.fit.theta[0] == pytest.approx(0.0137, rel=0.01)
    assert trial.explained > 0.99
    assert trial.price == pytest.approx(0.5 * np.log(n - 12))


def test_every_parameter_that_moves_the_fit_is_paid_for():
    """A stiff spring and a damper that ring with the load: both are seen, and both cost."""
    n = 640
    t = np.arange(n) / RATE
    load = 8 * np.sin(0.5 * t) + 8 * np.sign(np.sin(4 * t))
    spring = placed("joint_elasticity", "joint1")
    twist = run(t, 0 * t, load=load).term(spring, np.array([1000.0, 60.0]))[0]
    trial, _, _ = tried(noisy(twist, sigma=1e-5, n=n, load=load), spring, Whitener(np.zeros(0), 1e-5, 0))
    np.testing.assert_allclose(trial.fit.theta[:2], [1000.0, 60.0], rtol=0.02)
    assert trial.price == pytest.approx(np.log(n))
