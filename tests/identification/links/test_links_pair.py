"""What motor and link encoder differ by, term by term, and its fit: laws and deviations worked out by hand."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import xarray as xr
from encoder_pairs import RATE, motion, pair, placed, run

from snarelab.identification.links import pair as module
from snarelab.identification.links.pair import PairFit, deviations, fit_pair, held_out, load_links, pair_of
from snarelab.identification.search.noise import Whitener
from snarelab.models.floating.tree import FloatingTree

N = 256
TIME = np.arange(N) / RATE
WAVE = np.sin(3 * TIME)
GAIN, DRIFT = placed("sensor_gain", "q_link.joint1"), placed("sensor_drift", "q_link.joint1")


def test_a_gain_adds_its_error_times_the_position_and_a_drift_its_rate_times_the_time_since_the_start():
    one = run(WAVE, 0 * WAVE)
    for effect, size, by in ((GAIN, 0.25, WAVE), (DRIFT, -0.5, TIME)):
        value, slope = one.term(effect, np.array([size]))
        np.testing.assert_allclose(value, size * by, atol=1e-14)
        np.testing.assert_allclose(slope, by[:, None], atol=1e-14)


@pytest.mark.parametrize(
    ("at", "sign", "settled"), [("q_link.joint1", -1, slice(24, None)), ("q.joint1", 1, slice(-24))]
)
def test_a_late_link_encoder_stays_behind_and_a_late_motor_encoder_lets_it_run_ahead(at, sign, settled):
    """On a ramp by speed times delay. A delay begins at rest, at the end where its encoder's time begins."""
    value, slope = run(0.5 * TIME, 0 * TIME).term(placed("sensor_delay", at), np.array([0.03]))
    np.testing.assert_allclose(value[settled], sign * 0.5 * 0.03, rtol=1e-3)
    np.testing.assert_allclose(slope[settled, 0], sign * 0.5, rtol=2e-2)
    assert abs(value[0 if sign < 0 else -1]) < 0.004


def test_a_delay_begins_anew_after_a_gap():
    """The second run's first sample is read as it is, wherever the first one ended."""
    ramp = 0.5 * TIME
    parts = (slice(0, 100), slice(100, N))
    one, two = (run(ramp, 0 * ramp, segments=s) for s in (None, parts))
    late = placed("sensor_delay", "q_link.joint1")
    whole, cut = (x.term(late, np.array([0.03]))[0] for x in (one, two))
    np.testing.assert_allclose(cut[:100], whole[:100])
    assert abs(cut[100]) < 0.004
    np.testing.assert_allclose(cut[100:], whole[: N - 100], atol=1e-9)


def test_a_drive_twists_by_load_over_stiffness_against_the_load():
    """Load 6 N·m on 2000 N·m/rad: the link is 3 mrad behind, and by stiffness that changes by 3 mrad per 2000."""
    value, slope = run(WAVE, 0 * WAVE, load=6.0).term(placed("joint_elasticity", "joint1"), np.array([2000.0, 20.0]))
    np.testing.assert_allclose(value, -3e-3, rtol=1e-9)
    np.testing.assert_allclose(slope, np.tile([3e-3 / 2000, 0.0], (N, 1)), atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "effect", "units"),
    [
        ("revolute", "joint_elasticity", ["N*m/rad", "N*m*s/rad"]),
        ("prismatic", "joint_elasticity", ["N/m", "N*s/m"]),
        ("revolute", "backlash", ["N*m/rad", "N*m*s/rad", "rad"]),
        ("prismatic", "sensor_drift", ["m/s"]),
        ("revolute", "sensor_drift", ["rad/s"]),
        ("prismatic", "sensor_delay", ["s"]),
    ],
)
def test_units_have_the_joints_own_torque_and_position(kind, effect, units):
    one = pair(kind=kind)
    assert [one.unit(p) for p in placed(effect, "joint1").effect.parameters] == units


def test_bounds_are_multiples_of_the_joints_scales():
    """Peak torque 8 over travel 0.5 is 16; the gap's bound is a fifth of the travel; a delay's is absolute."""
    bounds = {
        (name, p.name): pair().bounds(p)
        for name in ("backlash", "sensor_delay", "sensor_drift")
        for p in placed(name, "joint1").effect.parameters
    }
    assert bounds["backlash", "stiffness"] == (32.0, 1.6e6)
    assert bounds["backlash", "damping"] == (0.0, 1.6e5)
    assert bounds["backlash", "gap"] == (0.0, 0.1)
    assert bounds["sensor_delay", "delay"] == (0.0, 0.2)
    assert bounds["sensor_drift", "rate"] == (-np.inf, np.inf)


def two_runs(**given):
    """Recordings of 256 samples in two parts and of 128, differing by gain 0.25, drift -0.5, and zeros 2 and -3."""
    ends = ((WAVE, TIME, 2.0), (WAVE[:128] ** 2, TIME[:128], -3.0))
    parts = ((slice(0, 200), slice(200, N)), None)
    runs = [run(q, 0.25 * q - 0.5 * t + z, segments=s) for (q, t, z), s in zip(ends, parts, strict=True)]
    return pair(*runs, **given)


def test_segments_of_all_recordings_stand_end_to_end():
    assert two_runs().segments == (slice(0, 200), slice(200, 256), slice(256, 384))


def test_the_residual_is_the_difference_less_all_terms_and_the_recordings_own_zero():
    both = two_runs()
    residual, slopes = both.linearised([GAIN, DRIFT], np.array([0.05, 0.1, 1.0, -1.0]))
    q, t = np.r_[WAVE, WAVE[:128] ** 2], np.r_[TIME, TIME[:128]]
    first = np.r_[np.ones(N), np.zeros(128)]
    np.testing.assert_allclose(slopes, np.stack([q, t, first, 1 - first], 1), atol=1e-14)
    np.testing.assert_allclose(residual, 0.2 * q - 0.6 * t + 1.0 * first - 2.0 * (1 - first), atol=1e-13)


def test_a_fit_finds_what_was_put_in_and_says_where_it_stands():
    found = fit_pair(two_runs(), [GAIN, DRIFT], np.zeros(4))
    np.testing.assert_allclose(found.theta, [0.25, -0.5, 2.0, -3.0], atol=1e-9)
    assert found.energy < 1e-16
    assert (found.parameters(GAIN), found.parameters(DRIFT)) == (slice(0, 1), slice(1, 2))
    np.testing.assert_allclose(found.zeros, [2.0, -3.0], atol=1e-9)
    with pytest.raises(KeyError, match=r"sensor_gain\.q\.joint1"):
        found.parameters(placed("sensor_gain", "q.joint1"))


def test_an_effect_of_several_parameters_moves_those_behind_it():
    spring = placed("joint_elasticity", "joint1")
    found = PairFit((GAIN, spring, DRIFT), np.arange(6.0), np.array([3.0, -4.0]), np.zeros((2, 6)))
    assert (found.parameters(spring), found.parameters(DRIFT)) == (slice(1, 3), slice(3, 4))
    assert found.zeros.tolist() == [4.0, 5.0]
    assert found.energy == 25.0


def test_parameters_that_are_held_or_bounded_stay_where_they_must():
    """A link's scale of -2 is out of bounds (an error of -1 at least); a drift that is held stays at its start.

    The rest by regression, but for the fit's last step, a millionth.
    """
    one = pair(run(WAVE, -2.0 * WAVE))
    assert fit_pair(one, [GAIN], np.array([-3.0, 0.0])).theta[0] == pytest.approx(-1.0)
    found = fit_pair(two_runs(), [GAIN, replace(DRIFT, hold=("rate",))], np.array([0.0, 0.1, 0.0, 0.0]))
    assert found.theta[1] == 0.1
    rows = found.residual + found.jacobian[:, [0, 2, 3]] @ found.theta[[0, 2, 3]]
    wanted = np.linalg.lstsq(found.jacobian[:, [0, 2, 3]], rows, rcond=None)[0]
    np.testing.assert_allclose(found.theta[[0, 2, 3]], wanted, atol=2e-5)


def test_a_whitened_fit_weighs_what_the_past_does_not_foretell():
    """Innovations (x - x_before / 2) / 4 of each part without its first sample; their regression by NumPy."""
    both = two_runs()
    noise = np.random.default_rng(3).normal(size=384)
    runs = [
        replace(r, motion=replace(r.motion, tau=r.motion.tau + x[:, None]))
        for r, x in zip(both.runs, (noise[:N], noise[N:]), strict=True)
    ]
    both = replace(both, runs=tuple(runs))
    found = fit_pair(both, [GAIN, DRIFT], np.zeros(4), Whitener(np.array([0.5]), 4.0, 1))

    def white(x):
        return np.concatenate([(x[s][1:] - 0.5 * x[s][:-1]) / 4 for s in both.segments])

    y, a = both.linearised([GAIN, DRIFT], np.zeros(4))
    wanted = np.linalg.lstsq(white(a), white(y), rcond=None)[0]
    np.testing.assert_allclose(found.theta, wanted, atol=2e-5)
    np.testing.assert_allclose(found.residual, white(y) - white(a) @ wanted, atol=2e-5)
    np.testing.assert_allclose(found.jacobian, white(a), atol=1e-12)


@pytest.mark.parametrize(
    ("residual", "parts", "square"),
    [
        ([1, 1, 1, 1, -1, -1, -1, -1], None, 32 / 64),  # clusters of 4 samples that add up to 4 and -4
        ([1, 1, 1, 1, -1, -1, -1, -1], (slice(0, 6), slice(6, 8)), 24 / 64),  # 4, -2 | -2
        ([1, 1, 1, 1, -1, -1, -1, -1], (slice(0, 2), slice(2, 8)), 8 / 64),  # 2 | 0, -2
        ([1, -1, 1, -1, 2, -2, 2, -2], None, 0.0),
    ],
)
def test_a_deviation_counts_what_half_a_second_shares_as_one(residual, parts, square):
    """At 8 samples a second, for a mean of 8: the square root of the clusters' squared sums over 8 squared."""
    one = pair(run(np.zeros(8), np.zeros(8), segments=parts, rate=8.0))
    found = PairFit((), np.zeros(1), np.array(residual, float), np.ones((8, 1)))
    assert deviations(one, found) == pytest.approx(np.sqrt([square]))


def test_deviations_of_several_parameters_are_a_sandwich_and_unknown_ones_are_infinite():
    rng = np.random.default_rng(5)
    a, r = rng.normal(size=(32, 3)) * [1.0, 1e-4, 1e3], rng.normal(size=32)
    one = pair(run(np.zeros(32), np.zeros(32), rate=16.0))  # clusters of 8
    found = PairFit((), np.zeros(4), r, np.insert(a, 1, 0.0, axis=1))
    scores = np.stack([a[k : k + 8].T @ r[k : k + 8] for k in range(0, 32, 8)])
    bread = np.linalg.inv(a.T @ a)
    wanted = np.sqrt(np.diag(bread @ scores.T @ scores @ bread))
    assert deviations(one, found) == pytest.approx([wanted[0], np.inf, wanted[1], wanted[2]], rel=1e-6)


def test_a_slow_recordings_cluster_is_one_sample_at_least():
    one = pair(run(np.zeros(4), np.zeros(4), rate=0.5))
    found = PairFit((), np.zeros(1), np.array([1.0, -1.0, 1.0, -1.0]), np.ones((4, 1)))
    assert deviations(one, found) == pytest.approx([0.5])


def test_what_is_held_out_gets_zeros_of_its_own_and_nothing_else():
    """Fitted to a gain of 0.25; held out with a gain of 0.75 and zeros 5 and -7: on a balanced wave these stand out."""
    balanced = np.r_[WAVE, -WAVE]
    one = pair(run(balanced, 0.25 * balanced + 1.0))
    other = pair(*(run(balanced, 0.75 * balanced + z) for z in (5.0, -7.0)))
    found = held_out(one, other, fit_pair(one, [GAIN], np.zeros(2)))
    np.testing.assert_allclose(found.theta, [0.25, 5.0, -7.0], atol=2e-5)
    np.testing.assert_allclose(found.residual, np.tile(0.5 * balanced, 2), atol=2e-5)
    assert found.placed == (replace(GAIN, hold=("error",)),)


def test_joints_with_a_second_encoder_that_moves_in_every_recording_are_compared(monkeypatch):
    """joint2's second encoder stands still in the second file, joint3 has none there."""
    ramp, still = np.arange(4.0), np.full(4, 2.0)

    def table(**columns):
        signals = {f"q.joint{k}": ("time", k * ramp) for k in (1, 2, 3)}
        links = {f"q_link.{joint}": ("time", x) for joint, x in columns.items()}
        return xr.Dataset(signals | links, coords={"time": ramp / 8})

    files = {
        "a": table(joint1=ramp + 0.5, joint2=ramp, joint3=ramp),
        "b": table(joint1=3 * ramp, joint2=still),
        "c": table(joint2=still),
    }
    monkeypatch.setattr(module, "read_motion", lambda _, path: files[path])
    monkeypatch.setattr(module, "condition", lambda dataset, joints, band: (dataset, joints, band))
    names = ("joint1", "joint2", "joint3")
    tree = SimpleNamespace(joints=[SimpleNamespace(name=n, kind="revolute") for n in names])
    model: Any = SimpleNamespace(tree=tree, joints=names, signals={})
    body: Any = object()
    joints, made = load_links(model, ["a", "b"], body, 20.0)
    assert joints == ("joint1",)
    first, second = (cast(Any, e.motion) for e in made)
    assert (first[1:], made[0].body) == ((names, 20.0), body)
    assert first[0]["tau.joint1"].values.tolist() == [0.5] * 4
    assert second[0]["tau.joint1"].values.tolist() == [0.0, 2.0, 4.0, 6.0]
    assert [second[0][f"tau.{n}"].values.tolist() for n in names[1:]] == [[0.0] * 4] * 2
    assert load_links(model, ["c"], body, 20.0) == ((), [])
    floating: Any = SimpleNamespace(tree=FloatingTree.__new__(FloatingTree))
    assert load_links(floating, ["a"], body, 20.0) == ((), [])


def test_a_pair_carries_its_own_joints_load_and_inertia():
    n, names = 5, ("joint1", "joint2")
    one: Any = SimpleNamespace(
        motion=motion(np.zeros((n, 2)), np.zeros((n, 2)), joints=names), mass_matrix=np.arange(20.0).reshape(n, 2, 2)
    )
    load = np.arange(10.0).reshape(n, 2)
    assembly: Any = SimpleNamespace(evaluate=lambda e, theta: SimpleNamespace(load=load * theta))
    joints = [SimpleNamespace(kind=kind) for kind in ("revolute", "prismatic")]
    model: Any = SimpleNamespace(joints=names, tree=SimpleNamespace(joints=joints))
    made = pair_of("joint2", model, [one], assembly, cast(Any, 3.0), pair().scales)
    (only,) = made.runs
    assert (made.joint, made.kind, only.joint) == ("joint2", "prismatic", 1)
    assert only.load.tolist() == [3.0, 9.0, 15.0, 21.0, 27.0]
    assert only.inertia.tolist() == [3.0, 7.0, 11.0, 15.0, 19.0]
