"""The third generator: its arms, its friction, its springs, its residuals, and the cases it writes."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import butter, sosfiltfilt

import snarelab
from proof.drives.places import joint
from proof.played.cases import DECK, GROUPS, planned, write
from proof.played.concealed import NAMES, TooMuch, by_search
from proof.played.laws import Slip, table, warmth
from proof.played.machine import Machine, TooSoft, beside_known
from proof.played.make import make
from proof.played.motions import STEP, motion
from proof.played.outside import FAULTS, OUTSIDE, beside_names, lawless
from proof.played.residuals import BAND, LOUDEST, RECORDINGS, Residual, play, residuals, rms, unexplained
from proof.played.robots import ARMS, load, published, true_arm, with_com, with_load
from snarelab.models.model_file import load_model
from snarelab.models.rigid_body import RigidBody

pytestmark = pytest.mark.skipif(
    not published(), reason="example-robot-data is not installed: make .venv/installed does it"
)

needs_recordings = pytest.mark.skipif(not RECORDINGS.exists(), reason=f"{RECORDINGS} is not there")


def arm_of(name: str):
    """A published arm by a part of its file's name."""
    file = next(x for x in ARMS if name in x)
    return load(published()[file], ARMS[file])


def bare(arm, level=1.0, viscous=0.5, rotor=0.0) -> Machine:
    """A machine with the same friction at every joint."""
    J = len(arm.joints)
    zero = np.zeros(J)
    slip = Slip((1e-3, 2e-3), (0.5, 0.5))
    return Machine(
        arm,
        (slip,) * J,
        level + zero,
        viscous + zero,
        rotor + zero,
        gain=1.0 + zero,
        offset=zero,
        drift=zero,
        delay=zero,
    )


@pytest.mark.parametrize("name", list(ARMS))
def test_published_arm_is_read_alike_by_the_tool(name, tmp_path):
    """The same URDF, joints and torque as the tool's own rigid bodies give, grippers locked."""
    arm = load(published()[name], ARMS[name])
    (tmp_path / "arm.urdf").write_text(arm.urdf)
    rows = ", ".join(f'"{j}"' for j in arm.joints)
    (tmp_path / "arm.toml").write_text(f'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\njoints = [{rows}]\n')
    model = load_model(tmp_path / "arm.toml")
    assert model.joints == arm.joints
    q, qd, qdd = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 5, len(arm.joints)))
    ours = RigidBody(model.tree).torque(q, qd, qdd)
    np.testing.assert_allclose(arm.dynamics().torque(q, qd, qdd), ours, rtol=1e-9, atol=1e-9)


def test_load_and_centre_of_mass_change_the_static_torque_by_their_weight():
    """At rest a load's torque is the derivative of its potential energy; a shift is one of the whole body's weight."""
    arm = arm_of("ur5")
    q, rest, step = np.array([[0.3, -0.8, 0.9, 0.4, -0.5, 0.2]]), np.zeros((1, 6)), 1e-6
    body = arm.dynamics()

    def height(at: np.ndarray) -> float:
        return float(body.tip(at)[0][2])

    slopes = [(height(q[0] + step * e) - height(q[0] - step * e)) / (2 * step) for e in np.eye(6)]
    loaded = with_load(arm, 5, 2.0, np.zeros(3)).dynamics().torque(q, rest, rest) - body.torque(q, rest, rest)
    np.testing.assert_allclose(loaded[0], 2.0 * 9.81 * np.array(slopes), rtol=1e-6, atol=1e-8)
    shift = np.array([0.01, -0.02, 0.03])
    moved = with_com(arm, 5, shift).dynamics().torque(q, rest, rest)
    at, centre = (
        with_load(arm, 5, float(arm.masses[5]), x).dynamics().torque(q, rest, rest) for x in (shift, 0 * shift)
    )
    np.testing.assert_allclose(moved - body.torque(q, rest, rest), at - centre, rtol=1e-9, atol=1e-12)


def test_slip_turns_round_as_maxwell_elements_do():
    """From full slip one way, going back by x each element has lost x/travel, until it slides the other way."""
    slip = Slip((1e-3, 4e-3), (0.25, 0.75))
    forth, back = np.linspace(0.0, 0.1, 2001), np.linspace(0.1, 0.08, 2001)
    found = slip.along(np.concatenate([forth, back]))
    assert found[2000] == pytest.approx(1.0)
    gone = 0.1 - back
    expected = 0.25 * np.maximum(1.0 - gone / 1e-3, -1.0) + 0.75 * np.maximum(1.0 - gone / 4e-3, -1.0)
    np.testing.assert_allclose(found[2001:], expected, atol=1e-9)


def test_table_passes_its_knots_and_repeats():
    knots = np.array([1.0, -2.0, 1.0])
    x = np.array([0.0, 0.1, 0.2, 0.3, 0.05])
    np.testing.assert_allclose(table(x, 0.3, knots), [1.0, -2.0, 1.0, 1.0, -0.5], atol=1e-12)


def test_warmth_settles_at_the_mean_power():
    """Constant power warms a joint as 1 - exp(-t/T)."""
    found = warmth(np.ones(20000), 4.0)
    time = STEP * np.arange(1, 20001)
    np.testing.assert_allclose(found, 1.0 - np.exp(-time / 4.0), atol=1e-9)


def test_every_joint_moves_in_every_motion():
    """Also where moves with stops end before the first one fits, and the tip does not feel the last joint."""
    arm = arm_of("kinova")
    for seed in range(3, 9):
        assert np.ptp(motion(np.random.default_rng(seed), arm, 4.0)[0], axis=0).min() > 1e-3, seed


def test_link_lags_behind_a_spring_by_the_torque_that_it_carries():
    """Spring and gravity alone, so slowly that nothing swings: the link stands where both balance."""
    arm = arm_of("ur5")
    time = np.arange(8000)[:, None] * STEP
    q = np.array([[0.1, -0.9, 0.7, 0.2, 0.3, 0.1]]) + 0.2 * np.sin(0.05 * time) * np.eye(6)[1]
    qd = np.gradient(q, STEP, axis=0)
    asked = (q, qd, np.gradient(qd, STEP, axis=0))
    softness = 2e-4
    soft = replace(bare(arm, 0.0, 0.0), bends=((1, lambda tau: softness * tau),))
    load_there, body, rest = soft.drive(asked).load, arm.dynamics(), np.zeros((1, 6))
    for at in (2000, 4000, 6000):
        goal = q[at]
        link: float = brentq(
            lambda x, g=goal: x - g[1] + softness * body.torque(_with(g, x), rest, rest)[0, 1], -2.0, 1.0
        )  # type: ignore
        balanced = body.torque(_with(goal, link), rest, rest)[0, 1]
        stiff = body.torque(goal[None], rest, rest)[0, 1]
        assert abs(load_there[at, 1] - balanced) < 0.05 * abs(balanced - stiff)


def _with(q: np.ndarray, x: float) -> np.ndarray:
    """A pose (1, J) with another second joint."""
    return np.array([[q[0], x, *q[2:]]])


def test_spring_that_swings_with_the_motion_is_no_spring():
    arm = arm_of("ur5")
    asked = motion(np.random.default_rng(3), arm, 4.0)
    soft = replace(bare(arm), bends=((1, lambda tau: 1e-2 * tau),))
    with pytest.raises(TooSoft):
        soft.drive(asked)


@pytest.mark.parametrize("name", list(NAMES))
def test_every_effect_has_the_wanted_size_at_its_place(name):
    """What known friction leaves of what the effect adds is as large as was asked for; of a link's, where it is the
    largest share of what was asked for, which is seldom the link's own joint."""
    arm = arm_of("ur5")
    asked = motion(np.random.default_rng(5), arm, 6.0)
    before = bare(arm, 2.0, 1.0, 0.3)
    k, wanted = 1, 0.3 * np.array([2.0, 1.0, 0.7, 0.2, 0.1, 0.05])
    made = NAMES[name](before, asked, k, wanted, np.random.default_rng(7))
    assert joint(made.at) == k + 1
    if made.hides or name == "sensor_delay":
        return
    apart = made.machine.read(made.machine.torque(asked)) - before.read(before.torque(asked))
    c = made.channel
    size = rms(apart[:, c]) if name.startswith("sensor_") and name != "sensor_gain" else 0.0
    size = size or beside_known(before, before.drive(asked), c, apart[:, c])
    assert size == pytest.approx(wanted[c], rel=0.05)
    assert made.raw == pytest.approx(rms(apart[:, c]), rel=0.05)
    if made.at.startswith("link"):
        every = [beside_known(before, before.drive(asked), i, x) for i, x in enumerate(apart.T)]
        assert np.all(every <= 1.05 * wanted)


@pytest.mark.parametrize("name", list(OUTSIDE))
def test_law_without_a_name_is_as_large_beside_the_named_ones(name):
    arm = arm_of("ur5")
    asked = motion(np.random.default_rng(5), arm, 6.0)
    before = bare(arm)
    made = lawless(OUTSIDE[name], before, asked, 1, 0.5, np.random.default_rng(7))
    apart = made.machine.torque(asked) - before.torque(asked)
    assert beside_names(before.drive(asked), 1, apart[:, 1]) == pytest.approx(0.5, rel=1e-6)
    assert np.abs(apart[:, [0, 2, 3, 4, 5]]).max() == 0.0


def test_residual_of_a_torque_that_motion_explains_is_the_noise_alone():
    """Friction by place, gravity and inertia are taken; a torque that hangs on nothing stays."""
    rng = np.random.default_rng(0)
    rate, time = 250.0, np.arange(5000) / 250.0
    q = np.stack([np.sin(0.9 * time) + 0.3 * np.sin(2.3 * time), np.cos(0.7 * time)], axis=1)
    qd = np.gradient(q, 1 / rate, axis=0)
    tau = np.stack([3.0 * np.sin(q[:, 0] + q[:, 1]) + np.tanh(qd[:, 0] / 0.02), 2.0 * qd[:, 1]], axis=1)
    noise = 0.1 * rng.standard_normal(tau.shape)
    left = unexplained(q, tau + noise, rate)
    share = np.sum(left * noise, axis=0) / np.sum(noise**2, axis=0)
    assert (share > 0.95).all()
    assert (np.sqrt(np.mean((left - noise) ** 2, axis=0)) < 0.04).all()


def test_played_residual_has_its_size_in_the_band_and_no_more_than_four_times_that():
    rng = np.random.default_rng(1)
    slow = Residual("slow", 250.0, (np.cumsum(rng.standard_normal(2500)),))
    fast = Residual("fast", 250.0, (np.diff(rng.standard_normal(2502), 2),))
    low = butter(4, BAND, fs=1000.0, output="sos")
    x = play(slow, 0, 1000.0, 20000, rng)
    assert rms(np.asarray(sosfiltfilt(low, x))) == pytest.approx(1.0, rel=1e-6)
    assert rms(play(fast, 0, 1000.0, 20000, rng)) == pytest.approx(LOUDEST, rel=1e-6)


@needs_recordings
def test_real_machines_leave_something_of_every_channel():
    found = residuals()
    assert {x.machine.split()[0] for x in found} == {"emps", "kuka_kr300", "tx40", "cart"}
    for x in found:
        assert all(np.isfinite(run).all() and rms(run) == pytest.approx(1.0) for run in x.runs)


def test_plans_follow_from_the_seed_and_have_the_shares_of_the_deck():
    plans = planned(11, 100)
    assert plans[:30] == planned(11, 30)
    assert {g: sum(p.group == g for p in plans) for g in GROUPS} == {g: 2 * DECK.count(g) for g in GROUPS}
    assert {len(p.concealed) for p in plans if p.group == "pair"} == {2, 3, 4}


@pytest.mark.slow
@needs_recordings
def test_case_is_written_whole_and_alike_from_its_seed(tmp_path):
    plans = planned(3, 50)
    k = next(i for i, p in enumerate(plans) if p.group == "single" and p.concealed[0][0] == "torque_ripple")
    for folder in ("one", "two"):
        write(plans[k], 3, k, tmp_path / folder)
    files = sorted(x.relative_to(tmp_path / "one") for x in (tmp_path / "one").rglob("*.*"))
    assert len(files) == 6 + 4
    for path in files:
        assert (tmp_path / "one" / path).read_bytes() == (tmp_path / "two" / path).read_bytes()
    truth = json.loads((tmp_path / "one" / "truth.json").read_text())
    # The twin has the same motion, and its torque lacks what is concealed and nothing else.
    own, twin = (np.genfromtxt(tmp_path / "one" / x / "third.csv", delimiter=",", names=True) for x in ("", "twin"))
    apart = {c: np.abs(own[c] - twin[c]).max() for c in own.dtype.names or ()}
    assert [c for c, x in apart.items() if x > 1e-8] == [truth["effects"][0]["channel"].replace(".", "")]
    assert [e["name"] for e in truth["effects"]] == ["torque_ripple"]
    found = snarelab.identify(tmp_path / "one" / "arm.toml", tmp_path / "one" / "train.csv")
    assert len(found.parameters) > 0


@pytest.mark.parametrize("name", list(FAULTS))
def test_fault_changes_what_it_says_and_nothing_else(name):
    n = 10
    time = np.arange(n) / 100.0
    columns = {"time": time} | {f"{x}.joint{k}": time + k for x in ("q", "tau") for k in (1, 2, 3)}
    changed = FAULTS[name](columns, 0)
    apart = {key for key in columns if not np.array_equal(changed[key], columns[key])}
    assert (
        apart
        == {
            "angles in degrees": {"q.joint1", "q.joint2", "q.joint3"},
            "torque in N·cm": {"tau.joint1", "tau.joint2", "tau.joint3"},
            "time in milliseconds": {"time"},
            "one torque with the wrong sign": {"tau.joint1"},
            "one encoder with the wrong sign": {"q.joint1"},
            "two torques exchanged": {"tau.joint1", "tau.joint2"},
        }[name]
    )


def test_folder_of_another_seed_is_refused(tmp_path, monkeypatch):
    (tmp_path / "seed.json").write_text('{"seed": 4}')
    monkeypatch.setattr("proof.played.make.residuals", lambda: ("something",))
    with pytest.raises(ValueError, match="holds cases of seed 4"):
        make(tmp_path, 5, 1)
    monkeypatch.setattr("proof.played.make.residuals", tuple)
    with pytest.raises(ValueError, match="nothing to play"):
        make(tmp_path, 4, 1)


def test_effect_that_no_hardware_has_is_drawn_again():
    arm = arm_of("ur5")
    asked = motion(np.random.default_rng(5), arm, 4.0)
    with pytest.raises(TooMuch):
        NAMES["sensor_delay"](bare(arm), asked, 1, np.full(6, 1e3), np.random.default_rng(0))
    never = by_search(lambda machine, *_: machine, "joint", 1e-3, 1.0)
    with pytest.raises(TooMuch):
        never(bare(arm), asked, 1, np.ones(6), np.random.default_rng(0))


def test_true_arm_is_off_by_one_to_five_per_cent():
    arm = arm_of("panda")
    other = true_arm(arm, np.random.default_rng(0))
    shares = np.abs(other.masses / arm.masses - 1.0)
    assert ((shares >= 0.01) & (shares <= 0.05)).all()
