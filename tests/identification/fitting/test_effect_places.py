"""What one effect adds to the torque channels: laws written out by hand on stand-in dynamics of two joints."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest

from snarelab.identification.fitting import effect_places
from snarelab.identification.fitting.effect_kinds import effect_place
from snarelab.identification.fitting.effect_law import RESPONSE, causal, impulse_response
from snarelab.identification.fitting.effect_places import LinkPlace, TorqueState
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.regressor import Regressor

N, PERIOD = 300, 5e-3
TIME = PERIOD * np.arange(N)


def wave(hertz, phase=0.0, shift=0.0):
    """A sine at rest where its runs begin; ``shift`` later."""
    turn = 2 * np.pi * hertz
    return np.sin(turn * (TIME + shift) + phase)


def run(segments=(slice(0, N),), links=1) -> Any:
    """Two joints; random regressor, tangents and inertia, so that every channel counts."""
    rng = np.random.default_rng(6)
    q, qd, qdd = (np.stack([wave(0.8, k + x), wave(0.5, k + x + 1.0)], 1) for k, x in ((0, 0.0), (1, 0.3), (2, 0.5)))
    motion = Made(q=q, qd=qd, qdd=qdd, temperature=np.full((N, 2), 20.0), period=PERIOD, segments=segments, time=TIME)
    by_position, by_rate = rng.normal(size=(2, N, 2, 2))
    return Made(
        motion=motion,
        elapsed=TIME,
        regressor=Regressor(rng.normal(size=(N, 20 * (links + 1))), np.ones((2, links + 1), bool)),
        tangent=(by_position, by_rate),
        mass_matrix=rng.normal(size=(N, 2, 2)),
    )


def added(e, name, at, parameters, joint=1, load=None, reading=None, scale=1.0, early_alone=False, tree=None) -> Any:
    joints = [Made(name=f"joint{k}", kind="revolute") for k in (1, 2)]
    own: Any = tree or Made(joints=joints, axes=(), coupled=lambda _: (0, 1))
    load, reading = (np.zeros((N, 2)) if x is None else np.stack([np.zeros(N), x], 1) for x in (load, reading))
    here = effect_place(own, PlacedEffect(get_effect(name), at), joint, scale, early_alone)
    return here.terms(TorqueState(e, load, reading), np.array(parameters, float))


def test_friction_and_a_spring_act_on_their_own_channel():
    e = run()
    q, qd = e.motion.q[:, 1], e.motion.qd[:, 1]
    ((channel, torque, by),), by_load, passed = added(e, "quadratic_friction", "joint2", [3.0])
    assert (channel, by_load, passed) == (1, None, None)
    np.testing.assert_allclose(torque, 3.0 * qd * np.abs(qd), atol=1e-12)
    np.testing.assert_allclose(by[:, 0], qd * np.abs(qd), atol=1e-12)
    ((_, torque, by),), *_ = added(e, "harness_stiffness", "joint2", [4.0, 0.5])
    np.testing.assert_allclose(torque, 4.0 * q + 0.5, atol=1e-12)
    np.testing.assert_allclose(by, np.stack([q, np.ones(N)], 1), atol=1e-12)


def test_friction_by_load_tells_how_it_follows_the_load():
    """c |load| sgn(v): c sgn(load) sgn(v) by the load, away from rest."""
    e, load = run(), 5.0 * wave(0.7, 0.2)
    ((_, torque, by),), by_load, _ = added(e, "load_dependent_friction", "joint2", [0.3], load=load)
    sign = np.sign(e.motion.qd[:, 1])
    fast = (np.abs(e.motion.qd[:, 1]) > 0.1) & (np.abs(load) > 0.5)
    np.testing.assert_allclose(torque[fast], (0.3 * np.abs(load) * sign)[fast], rtol=1e-2)
    np.testing.assert_allclose(by[fast, 0], (np.abs(load) * sign)[fast], rtol=1e-2)
    assert by_load is not None
    np.testing.assert_allclose(by_load[fast], (0.3 * np.sign(load) * sign)[fast], rtol=1e-2)


def test_a_links_change_goes_through_its_own_columns_of_the_regressor():
    """2 kg at (0.1, -0.2, 0.3) + (0.4, 0.5, 0.6) of the second link; inertia terms of a point mass."""
    e = run()
    phi = np.arange(1.0, 11.0)
    joints = [Made(parent=-1), Made(parent=0), Made(parent=1, translation=np.array([0.1, -0.2, 0.3]))]
    tree: Any = Made(joints=joints, links=[None, Made(phi=phi)], n_joints=3)
    x, y, z = 0.5, 0.3, 0.9
    point = np.array([1, x, y, z, y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y])
    terms, by_load, passed = added(e, "payload_mass", "link2", [2.0, 0.4, 0.5, 0.6], tree=tree)
    assert (by_load, passed) == (None, None)
    assert [c for c, *_ in terms] == [0, 1]
    for c, torque, by in terms:
        columns = e.regressor.dense()[:, c, 10:20]
        np.testing.assert_allclose(torque, columns @ (2.0 * point), atol=1e-12)
        np.testing.assert_allclose(by[:, 0], columns @ point, atol=1e-12)
        along_x = 2.0 * np.array([0, 1, 0, 0, 0, -y, -z, 2 * x, 0, 2 * x])
        np.testing.assert_allclose(by[:, 1], columns @ along_x, atol=1e-12)
    here = LinkPlace(tree, PlacedEffect(get_effect("inertia_error"), "link2"), 1, 1.0)
    change, _ = here.change(np.arange(10.0))
    np.testing.assert_allclose(change, np.arange(10.0), atol=1e-12)
    # Its density by one factor; no mass at a point, and no place of it, does that.
    once_more = here.once_more(np.zeros(10))
    assert once_more is not None
    np.testing.assert_allclose(once_more, phi)
    for name, values in (("payload_mass", [1.0, 0, 0, 0]), ("com_offset", [0.0, 0, 0])):
        other = LinkPlace(tree, PlacedEffect(get_effect(name), "link2"), 1, 1.0)
        assert other.once_more(np.array(values)) is None


def test_a_sensor_changes_what_it_reads_and_the_columns_behind_it():
    e, reading = run(), 7.0 + wave(0.6)
    ((channel, torque, by),), by_load, passed = added(e, "sensor_gain", "tau.joint2", [0.25], reading=reading)
    assert (channel, by_load) == (1, None)
    np.testing.assert_allclose(torque, 0.25 * reading, atol=1e-12)
    np.testing.assert_allclose(by[:, 0], reading, atol=1e-12)
    columns = np.stack([wave(1.0), wave(2.0)], 1)
    np.testing.assert_allclose(passed(columns), 1.25 * columns, atol=1e-12)
    ((_, torque, by),), _, passed = added(e, "sensor_drift", "tau.joint2", [0.5], reading=reading)
    np.testing.assert_allclose(torque, 0.5 * TIME, atol=1e-12)
    np.testing.assert_allclose(by[:, 0], TIME, atol=1e-12)
    np.testing.assert_allclose(passed(columns), columns, atol=1e-12)


DELAY = 0.0125
"""[s] Two and a half samples."""

INNER = slice(60, N - 60)
"""Where neither end of a run is felt."""


@pytest.mark.parametrize(
    ("name", "at", "early_alone", "later"),
    [
        ("sensor_delay", "tau.joint2", False, -DELAY),
        ("sensor_delay", "q.joint2", True, DELAY),
        ("command_delay", "tau.joint2", False, DELAY),
    ],
)
def test_a_late_torque_a_late_encoder_that_makes_its_channel_early_and_a_command(name, at, early_alone, later):
    e, reading = run(), wave(0.6, 0.4)
    terms, _, passed = added(e, name, at, [DELAY], reading=reading, early_alone=early_alone)
    ((channel, torque, by),) = terms
    assert channel == 1
    np.testing.assert_allclose(torque[INNER], (wave(0.6, 0.4, later) - reading)[INNER], atol=2e-4)
    slope = 2 * np.pi * 0.6 * np.cos(2 * np.pi * 0.6 * (TIME + later) + 0.4) * np.sign(later)
    np.testing.assert_allclose(by[INNER, 0], slope[INNER], atol=0.03)
    columns = np.stack([wave(0.9), wave(0.3)], 1)
    moved = np.stack([wave(0.9, 0.0, later), wave(0.3, 0.0, later)], 1)
    np.testing.assert_allclose(passed(columns)[INNER], moved[INNER], atol=1e-3)


def test_a_late_encoder_moves_all_that_the_joint_does_to_first_order():
    """Its position, rate and acceleration come early, through the tangents of every channel; what is beside the rigid
    body's torque in its own channel comes early as well."""
    e, load, reading = run(), wave(0.4), wave(0.4) + wave(0.6, 0.4)
    terms, _, _ = added(e, "sensor_delay", "q.joint2", [DELAY], load=load, reading=reading)
    turn, phases = 2 * np.pi * 0.5, (1.0, 2.3, 3.5)
    changes = [np.sin(turn * (TIME + DELAY) + p) - np.sin(turn * TIME + p) for p in phases]
    beside = wave(0.6, 0.4, DELAY) - wave(0.6, 0.4)
    by_position, by_rate = e.tangent
    assert [c for c, *_ in terms] == [0, 1]
    for c, torque, by in terms:
        paths = (by_position[:, c, 1], by_rate[:, c, 1], e.mass_matrix[:, c, 1])
        wanted = np.sum(np.multiply(changes, paths), axis=0) + (beside if c == 1 else 0.0)
        np.testing.assert_allclose(torque[INNER], wanted[INNER], atol=2e-3)
        slopes = [turn * np.cos(turn * (TIME + DELAY) + p) for p in phases]
        wanted = np.sum(np.multiply(slopes, paths), axis=0)
        if c == 1:
            wanted = wanted + 2 * np.pi * 0.6 * np.cos(2 * np.pi * 0.6 * (TIME + DELAY) + 0.4)
        np.testing.assert_allclose(by[INNER, 0], wanted[INNER], atol=0.15)


def test_a_soft_drive_lets_the_link_stay_behind_by_what_the_load_twists_it():
    """Slow load, stiff spring: the twist is load / stiffness, and its rates follow; it acts along the tangents."""
    e = run()
    e.mass_matrix[:, 1, 1] = 2.0
    turn, stiffness = 2 * np.pi * 0.5, 4e4
    load = 50.0 * np.cos(turn * TIME)
    terms, by_load, passed = added(e, "joint_elasticity", "joint2", [stiffness, 400.0], load=load)
    assert (by_load, passed) == (None, None)
    twist = load / stiffness
    rate, second = -50.0 * turn * np.sin(turn * TIME) / stiffness, -(turn**2) * twist
    by_position, by_rate = e.tangent
    for c, torque, _ in terms:
        wanted = -(by_position[:, c, 1] * twist + by_rate[:, c, 1] * rate + e.mass_matrix[:, c, 1] * second)
        # The damper delays the twist by 400 / 40000 = 10 ms, the load's turn of which is 3 %.
        assert np.abs(torque - wanted)[INNER].max() < 0.06 * np.abs(wanted).max()


def test_hidden_states_start_at_rest_in_every_run():
    """A late channel begins with what it reads then; a step between two runs never comes."""
    segments = (slice(0, 100), slice(100, N))
    e, reading = run(segments), np.where(np.arange(N) < 100, 2.0, 5.0)
    for at in ("tau.joint2", "q.joint2"):
        ((_, torque, _),), _, passed = added(e, "sensor_delay", at, [0.05], reading=reading, early_alone=True)
        np.testing.assert_allclose(torque, 0.0, atol=1e-9)
        np.testing.assert_allclose(passed(reading[:, None])[:, 0], reading, atol=1e-6)
    ((_, torque, _),), *_ = added(run(), "sensor_delay", "tau.joint2", [0.05], reading=reading)
    assert torque[101] == pytest.approx(-3.0, abs=0.3)  # in one run it comes 10 samples late
    assert torque[150] == pytest.approx(0.0, abs=1e-4)


def test_acausal_filter_has_seen_the_first_row_for_ever():
    columns = np.array([[2.0, 1.0], [4.0, 1.0], [6.0, 1.0], [0.0, 3.0]])
    found = causal(columns, np.array([0.5, 0.3, 0.2]))
    np.testing.assert_allclose(found[:, 0], [2.0, 0.5 * 4 + 0.5 * 2, 0.5 * 6 + 0.3 * 4 + 0.2 * 2, 0.3 * 6 + 0.2 * 4])
    np.testing.assert_allclose(found[:, 1], [1.0, 1.0, 1.0, 2.0])
    np.testing.assert_allclose(causal(columns, np.array([2.0])), 2 * columns)


def test_theimpulse_response_of_a_delay_has_unit_sum_and_its_delay_as_its_middle():
    """Padé's delay passes a constant whole and a ramp by the delay late: moments 1 and 4 samples."""
    response = impulse_response(get_effect("sensor_delay"), np.array([4 * PERIOD]), PERIOD)
    assert len(response) < RESPONSE - 1
    assert abs(response[-1]) > 1e-9
    assert response.sum() == pytest.approx(1.0, abs=1e-6)
    assert response @ np.arange(len(response)) == pytest.approx(4.0, abs=1e-4)
    instant = impulse_response(get_effect("sensor_delay"), np.array([0.0]), PERIOD)
    assert instant[0] == pytest.approx(1.0, abs=1e-3)


def test_what_an_effect_gives_to_a_floating_base_nothing_else_has_to_supply(monkeypatch):
    """A moment of (1, 2, 3) from outside is taken off the base's channels 3 to 5, and so is its derivative."""
    read = {name: np.zeros((N, 3)) for name in ("spin", "spin_gained", "impulse", "spin_rate", "acceleration")}
    monkeypatch.setattr(effect_places, "base_signals", lambda _: read | {"time": TIME})
    terms, *_ = added(run(), "external_torque", "base", [1.0, 2.0, 3.0], joint=5)
    assert [c for c, *_ in terms] == [3, 4, 5]
    for k, (_, moment, by) in enumerate(terms):
        np.testing.assert_allclose(moment, -(k + 1.0))
        np.testing.assert_allclose(by, np.tile(-np.eye(3)[k], (N, 1)))
