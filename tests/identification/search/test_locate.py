"""Where the misfit stands, for additions whose channel, time and state are known beforehand."""

import re

import numpy as np
import pytest

from bench.arm import random_arm
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.experiment import Experiment, scales
from snarelab.identification.search.locate import MOST_WINDOWS, locate
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.rigid_body import RigidBody
from snarelab.models.urdf import load_urdf
from snarelab.recordings.condition import Motion

PERIOD, N = 5e-3, 4000  # 20 s
TIME = np.asarray(100.0 + PERIOD * np.arange(N), np.float64)


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    """A revolute joint that carries a prismatic one."""
    for seed in range(100):
        arm = random_arm(np.random.default_rng(seed), 2, 0.5)
        if [link.kind for link in arm.links] == ["revolute", "prismatic"]:
            path = tmp_path_factory.mktemp("arm") / "arm.urdf"
            path.write_text(arm.urdf())
            return RigidBody(load_urdf(path, (0.0, 0.0, -9.81)))
    raise AssertionError("no such arm in 100 draws")


def experiment(body, qd, q=None, tau: float | np.ndarray = 10.0, segments=None):
    """A recording with these rates (n, 2); positions are free, since friction does not ask for them."""
    q = np.cumsum(qd, axis=0) * PERIOD if q is None else q
    torque = np.broadcast_to(tau, qd.shape) * np.sqrt(2) * np.sin(7 * TIME)[:, None]
    none = np.full_like(qd, np.nan)
    parts = segments or (slice(0, N),)
    recorded = Motion(
        "run.csv",
        ("joint1", "joint2"),
        PERIOD,
        100 / 3,
        TIME,
        q,
        qd,
        0 * qd,
        torque,
        none,
        parts,
        3,
        (),
        np.zeros((3, q.shape[1])),
    )
    return Experiment(recorded, body)


def waves():
    return np.stack([np.sin(2 * np.pi * 0.7 * TIME), 0.3 * np.cos(2 * np.pi * 0.45 * TIME)], 1)


def found(experiments, effects):
    """`locate` for what effects add to the rigid body's torque; ``{(name, joint): parameters}``."""

    def made(entries):
        placed = [PlacedEffect(get_effect(name), at) for name, at in entries]
        assembly = TorqueModel(experiments[0].body.tree, placed, None, scales(experiments), {})
        theta = np.array([x for values in entries.values() for x in values], float)
        assert len(theta) == len(assembly.slots)
        return [assembly.torque(e, theta) for e in experiments]

    added = zip(experiments, made({}), made(effects), strict=True)
    return locate(experiments, [e.motion.to_band(after - before) for e, before, after in added])


def test_nothing_added_stands_nowhere(body):
    assert found([experiment(body, waves())], {}) == ()
    assert found([experiment(body, waves())], {("viscous_friction", "joint1"): [0.0]}) == ()


def test_channels_by_their_share_of_the_change(body):
    """Energies 9 to 1 where both channels' torques are alike."""
    qd = waves()
    level = {("coulomb_friction", "joint1"): [1.0], ("coulomb_friction", "joint2"): [3.0]}
    two, one = found([experiment(body, qd)], level)
    assert (two.channel, one.channel) == ("tau.joint2", "tau.joint1")
    assert two.share == pytest.approx(0.9, abs=0.005)
    assert two.share + one.share == pytest.approx(1.0)


def test_newtons_and_newton_metres_compare(body):
    """What counts is the change relative to the channel's own torque: here 1 of 10 N*m and 30 of 300 N."""
    level = {("coulomb_friction", "joint1"): [1.0], ("coulomb_friction", "joint2"): [30.0]}
    answer = found([experiment(body, waves(), tau=np.array([10.0, 300.0]))], level)
    assert [x.share for x in answer] == pytest.approx([0.5, 0.5], abs=0.01)


def test_a_channel_below_a_hundredth_is_not_named(body):
    level = {("coulomb_friction", "joint1"): [1.0], ("coulomb_friction", "joint2"): [0.05]}
    (only,) = found([experiment(body, waves())], level)
    assert only.channel == "tau.joint1"
    assert 0.99 < only.share < 1.0


def test_windows_are_where_the_joint_moves(body):
    moving = ((TIME > 104.0) & (TIME < 106.0)) | ((TIME > 113.0) & (TIME < 114.0))
    qd = waves() * moving[:, None]
    (only,) = found([experiment(body, qd)], {("coulomb_friction", "joint1"): [2.0]})
    assert only.time_windows
    for start, stop in only.time_windows:
        assert stop > start
        middle = np.linspace(start, stop, 50)[1:-1]
        assert np.all(((middle > 103.4) & (middle < 106.6)) | ((middle > 112.4) & (middle < 114.6)))
    # They hold the half that the docstring promises, and not everything.
    length = sum(stop - start for start, stop in only.time_windows)
    assert 1.4 <= length <= 2.5
    assert list(only.time_windows) == sorted(only.time_windows)


def test_a_short_burst_is_found_to_the_half_second(body):
    qd = waves()
    qd[:, 0] = np.where((TIME > 110.2) & (TIME < 110.4), 1.0, 1e-9)
    (only,) = found([experiment(body, qd)], {("viscous_friction", "joint1"): [2.0]})
    ((start, stop),) = only.time_windows
    assert start < 110.2
    assert stop > 110.4
    assert stop - start <= 1.01


def test_windows_are_few_and_inside_the_recording(body):
    burst = np.mod(TIME, 1.1) < 0.3  # eighteen of them
    qd = waves()
    qd[:, 0] = np.where(burst, 1.0, 1e-9)
    (only,) = found([experiment(body, qd)], {("viscous_friction", "joint1"): [2.0]})
    assert 1 < len(only.time_windows) <= MOST_WINDOWS
    assert all(TIME[0] <= a < b <= TIME[-1] for a, b in only.time_windows)
    assert all(a[1] < b[0] for a, b in zip(only.time_windows, only.time_windows[1:], strict=False))


def state(body, effects, qd=None, q=None):
    (only,) = found([experiment(body, waves() if qd is None else qd, q)], effects)
    return only.where


@pytest.mark.parametrize(("sign", "where"), [(1, "qd.joint1 > 0"), (-1, "qd.joint1 < 0")])
def test_state_of_friction_in_one_direction(body, sign, where):
    """Viscous and asymmetric friction that cancel in one direction and add up in the other."""
    both = {("viscous_friction", "joint1"): [2.0], ("asymmetric_friction", "joint1"): [0.0, 4.0 * sign]}
    assert state(body, both) == f"{where} (100 % of it, in 50 % of the time)"


def test_state_of_viscous_friction_is_speed(body):
    where = state(body, {("viscous_friction", "joint1"): [2.0]})
    level = re.match(r"\|qd\.joint1\| > ([0-9.]+) rad/s \(([0-9]+) % of it, in ([0-9]+) % of the time\)", where)
    assert level, where
    speed = np.abs(waves()[:, 0])
    fast = speed > float(level[1])
    assert np.mean(fast) == pytest.approx(int(level[3]) / 100, abs=0.03)
    assert np.sum(speed[fast] ** 2) / np.sum(speed**2) == pytest.approx(int(level[2]) / 100, abs=0.03)


def test_state_of_the_stribeck_bump_is_near_rest(body):
    qd = np.stack([np.sin(2 * np.pi * 0.1 * TIME), waves()[:, 1]], 1)  # slow, so that the band shows the bump
    where = state(body, {("stribeck_friction", "joint1"): [5.0, 0.03]}, qd=qd)
    assert where.startswith("|qd.joint1| within 5 % of rest"), where


def test_state_of_a_harness_is_position_in_metres(body):
    q = np.stack([0 * TIME, 0.2 * np.linspace(0, 1, N) ** 6], 1)
    where = state(body, {("harness_stiffness", "joint2"): [100.0, 0.0]}, q=q)
    assert re.match(r"q\.joint2 > [0-9.e-]+ m \(", where), where


def test_state_of_a_level_that_is_always_there(body):
    qd = np.stack([np.sign(np.sin(TIME)), waves()[:, 1]], 1)
    where = state(body, {("sensor_bias", "tau.joint1"): [3.0]}, qd=qd)
    assert where == "throughout the motion"


def test_several_recordings_are_weighed_together(body):
    still = np.stack([np.full(N, 1e-9), waves()[:, 1]], 1)
    level = {("viscous_friction", "joint1"): [1.0], ("viscous_friction", "joint2"): [1.0]}
    moves, stands = experiment(body, waves()), experiment(body, still)
    share = {x.channel: x.share for x in found([moves, stands], level)}
    # Mean squares of the rates: 0.5 in one of the two recordings, 0.045 in both.
    assert share["tau.joint1"] == pytest.approx(0.5 / (0.5 + 0.09), abs=0.01)


def test_no_window_where_the_first_recording_shows_nothing(body):
    still = np.stack([np.zeros(N), waves()[:, 1]], 1)
    answer = found([experiment(body, still), experiment(body, waves())], {("viscous_friction", "joint1"): [1.0]})
    assert answer[0].time_windows == ()


def test_gaps_do_not_disturb_the_windows(body):
    qd = waves()
    qd[:, 0] = np.where((TIME > 110.2) & (TIME < 110.4), 1.0, 1e-9)
    split = (slice(0, 1200), slice(1500, N))
    (only,) = found([experiment(body, qd, segments=split)], {("viscous_friction", "joint1"): [2.0]})
    ((start, stop),) = only.time_windows
    assert start < 110.2 < 110.4 < stop <= start + 1.01
