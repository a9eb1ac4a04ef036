"""What motor and link encoder differ by, term by term, and its fit: laws and deviations worked out by hand."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import xarray as xr
from encoder_pairs import RATE, SCALES, links, motion, placed, run

from snarelab.identification.deciding import SIZES
from snarelab.identification.links import run as module
from snarelab.identification.links.run import load_links
from snarelab.identification.links.source import links_of, start
from snarelab.identification.sources.source import ModelPoint
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
    one, p = links(run(WAVE, WAVE), kind=kind), placed(effect, "joint1")
    assert [one.unit(p, x) for x in p.effect.parameters] == units


def test_bounds_are_multiples_of_the_joints_scales():
    """Peak torque 8 over travel 0.5 is 16; the gap's bound is a fifth of the travel; a delay's is absolute."""
    one = links(run(WAVE, WAVE))
    bounds = {
        (name, x.name): one.bounds(placed(name, "joint1"), x)
        for name in ("backlash", "sensor_delay", "sensor_drift")
        for x in placed(name, "joint1").effect.parameters
    }
    assert bounds["backlash", "stiffness"] == (32.0, 1.6e6)
    assert bounds["backlash", "damping"] == (0.0, 1.6e5)
    assert bounds["backlash", "gap"] == (0.0, 0.1)
    assert bounds["sensor_delay", "delay"] == (0.0, 0.2)
    assert bounds["sensor_drift", "rate"] == (-np.inf, np.inf)


def test_seven_effects_can_make_two_encoders_differ():
    """A second of a name at a joint is an alias of the first."""
    every = {
        "sensor_bias.q_link.joint1",
        "sensor_delay.q.joint1",
        "sensor_delay.q_link.joint1",
        "sensor_gain.q_link.joint1",
        "sensor_drift.q_link.joint1",
        "joint_elasticity.joint1",
        "backlash.joint1",
    }
    one = links(run(WAVE, WAVE))
    assert {p.key for p in one.library(())} == every
    late = placed("sensor_delay", "q.joint1")
    assert {p.key for p in one.library((late,))} == {key for key in every if "delay" not in key}


def test_a_grid_is_in_the_joints_scales():
    """Peak torque 8 over travel 0.5 is 16."""
    one = links(run(WAVE, WAVE))
    springs = one.variants(placed("joint_elasticity", "joint1"))
    wanted = [(k * 16, d * 16) for k in (10, 30, 100, 300, 1000, 3000) for d in (0.01, 0.1, 1.0)]
    np.testing.assert_allclose([list(v.values.values()) for v in springs], wanted)
    assert all(v.amplitudes == () for v in springs)
    (gain,) = one.variants(GAIN)
    assert (gain.values, gain.amplitudes, gain.size) == ({}, ("sensor_gain.q_link.joint1.error",), 0.0)


def test_a_zero_may_be_as_large_as_the_largest_reading():
    """Readings of 2 and of 3 RMS: a bias of the largest size averaged over is as wide."""
    one = links(run(WAVE, np.full(N, 2.0)), run(WAVE, np.full(N, -3.0)))
    (bias,) = one.variants(placed("sensor_bias", "q_link.joint1"))
    assert bias.size * SIZES[-1] == pytest.approx(3.0)
    at = one.settled(ModelPoint.of((), {}, one.n_shifts), one.train)
    np.testing.assert_allclose(one.zeros(at)[:, 0], [2.0, -3.0])
    np.testing.assert_allclose(at.shifts, [2 / 3, -1.0])


@pytest.mark.parametrize("late", ["q", "q_link"])
def test_what_is_foretold_is_the_sum_of_the_terms_and_the_recordings_own_zero(late):
    """Its slopes are those of differences, for a spring that rings and a late encoder too."""
    loads = [8 * np.sign(np.sin(4 * TIME)), 5 * np.cos(2 * TIME)]
    one = links(*(run(WAVE, WAVE, load=x, inertia=0.5) for x in loads))
    spring, delay = placed("joint_elasticity", "joint1"), placed("sensor_delay", f"{late}.joint1")
    values = {f"{spring.key}.stiffness": 900.0, f"{spring.key}.damping": 9.0, f"{delay.key}.delay": 0.013}
    values |= {f"{GAIN.key}.error": 0.02}
    at = replace(ModelPoint.of((spring, delay, GAIN), values, 2), shifts=np.array([0.5, -0.25]))
    for i, r in enumerate(one.rows):
        terms = [r[0].term(p, at.of_effect(p))[0] for p in at.placed]
        here = one.predicted(i, at)
        np.testing.assert_allclose(here[:, 0], sum(terms) + one.zeros(at)[i, 0], atol=1e-14)
        slopes = np.concatenate([one.slopes(i, at, here), one.shift_slopes(i, at, here)], axis=2)
        for k, step in enumerate([1e-2, 1e-3, 1e-6, 1e-6, 1e-3, 1e-3]):
            up, down = (
                replace(at, values=at.values + s * np.eye(6)[k, :4], shifts=at.shifts + s * np.eye(6)[k, 4:])
                for s in (step, -step)
            )
            wanted = (one.predicted(i, up) - one.predicted(i, down)) / (2 * step)
            np.testing.assert_allclose(slopes[:, :, k], wanted, atol=2e-5 * np.abs(wanted).max() + 1e-12)


def test_a_held_parameter_has_no_slope():
    one = links(run(WAVE, WAVE, load=6.0))
    spring = placed("joint_elasticity", "joint1", hold=("damping",))
    at = ModelPoint.of([spring], {f"{spring.key}.stiffness": 2000.0, f"{spring.key}.damping": 20.0}, 1)
    assert at.keys == (f"{spring.key}.stiffness",)
    slopes = one.slopes(0, at, one.predicted(0, at))
    np.testing.assert_allclose(slopes, np.full((N, 1, 1), 3e-3 / 2000), atol=1e-12)


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
    tree = SimpleNamespace(joints=[SimpleNamespace(name=n, kind="revolute") for n in names], carriers=0)
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


def test_encoders_carry_their_own_joints_load_and_inertia():
    n, names = 5, ("joint1", "joint2")
    one: Any = SimpleNamespace(
        motion=motion(np.zeros((n, 2)), np.ones((n, 2)), joints=names), mass_matrix=np.arange(20.0).reshape(n, 2, 2)
    )
    load = np.arange(10.0).reshape(n, 2)
    assembly: Any = SimpleNamespace(evaluate=lambda e, theta: SimpleNamespace(load=load * theta))
    joints = [SimpleNamespace(kind=kind) for kind in ("revolute", "prismatic")]
    model: Any = SimpleNamespace(joints=names, tree=SimpleNamespace(joints=joints))
    made = links_of(["joint2"], model, [one], [one], assembly, cast(Any, 3.0), {"joint2": SCALES})
    (only,), _ = made.rows
    assert (made.joints, made.kinds, only.joint) == (("joint2",), ("prismatic",), 1)
    assert (made.train, made.held) == (range(1), range(1, 2))
    assert only.load.tolist() == [3.0, 9.0, 15.0, 21.0, 27.0]
    assert only.inertia.tolist() == [3.0, 7.0, 11.0, 15.0, 19.0]


def test_only_what_lies_between_the_two_encoders_is_taken_from_the_model():
    """A spring and a drift at this joint; neither its friction nor another joint's spring."""
    spring = placed("joint_elasticity", "joint1")
    others = (placed("coulomb_friction", "joint1"), placed("joint_elasticity", "joint2"))
    values = {"joint_elasticity.joint1.stiffness": 900.0, "sensor_drift.q_link.joint1.rate": 0.5}
    model: Any = SimpleNamespace(effects=(others[0], spring, others[1], DRIFT), values=values)
    at = start(links(run(WAVE, WAVE)), model)
    assert at.placed == (spring, DRIFT)
    # The damper's usual value: a tenth of peak torque 8 over travel 0.5.
    assert at.values == pytest.approx([900.0, 1.6, 0.5])
