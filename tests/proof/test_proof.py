"""The proof's own facts: cases as planned, of the sizes demanded, recorded as the laws say."""

import copy
import re
import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from bench.arm import Arm, Link, random_arm
from bench.concealed import FRICTION
from bench.lugre import LuGre
from proof import cases, oracle, rivals, run
from proof.cases import ROUND, SIZES, draw, planned_cases, shows
from proof.concealed import MAKERS, NOT_YET, VALUES, play, with_mass
from proof.judge import judge
from proof.outside import OUTSIDE
from proof.plant import ProofPlant, band_rms, floor, record
from proof.robots import random_friction, random_robot
from proof.third import left
from snarelab.models.effects import effects
from snarelab.models.model import places
from snarelab.models.model_file import load_model

SEED = 90500


def drawn(kind: str, size: float = 2.0, group: str = "single", number: int = 0):
    return draw((group, (kind,), size), SEED, number, 0)


def rms(x) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


# The plan


def test_plan_has_every_effect_of_an_arm_at_every_size(tmp_path):
    (tmp_path / "arm.urdf").write_text(random_arm(np.random.default_rng(0), 2).urdf())
    (tmp_path / "arm.toml").write_text('system = "arm"\nurdf = "arm.urdf"\n')
    tree = load_model(tmp_path / "arm.toml").tree
    vocabulary = {name for name, effect in effects().items() if places(effect, tree)}
    assert set(MAKERS) == vocabulary - set(NOT_YET)
    page = (Path(__file__).resolve().parents[2] / "docs" / "proof.md").read_text(encoding="utf-8")
    assert all(f"`{name}`" in page for name in NOT_YET)
    assert all(VALUES[n] in [p.name for p in effects()[n].parameters] for n in VALUES)
    assert set(VALUES) <= set(MAKERS)
    assert {(*k, s) for g, k, s in ROUND if g == "single"} == {(n, s) for n in MAKERS for s in SIZES}
    assert len(ROUND) >= 120
    assert sorted(planned_cases(len(ROUND), 3)) == sorted(ROUND)
    assert planned_cases(9, 3) == planned_cases(len(ROUND), 3)[:9]


def test_robots_are_of_another_family_and_physical():
    rng = np.random.default_rng(1)
    for n in range(3, 7):
        arm = random_robot(rng, n)
        mujoco.MjModel.from_xml_string(arm.mjcf())  # pyright: ignore[reportAttributeAccessIssue]  # it checks inertia
        for link in arm.links:
            moments = np.linalg.eigvalsh(link.inertia)
            assert moments[0] > 0
            assert moments[0] + moments[1] >= moments[2]
        assert set(random_friction(rng, arm, np.full(n, 10.0))) == set(arm.joints)


# Sizes


LAWS: dict[str, Callable] = {
    "quadratic_friction": lambda x, m: x * np.abs(m.own[1]) * m.own[1],
    "rotor_inertia": lambda x, m: x * m.own[2],
    "sensor_bias": lambda x, m: x * np.ones(len(m.q)),
    "viscous_friction": lambda x, m: x * m.own[1],
}


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("size", [0.5, 4.0])
def test_effect_has_the_size_demanded_after_known_friction_took_its_part(kind, size):
    case = drawn(kind, size)
    (m,), (value,) = case.planned, case.answer.value
    torque = LAWS[kind](value, m)
    known = [np.sign(m.own[1])] + ([m.own[1]] if kind != "viscous_friction" else [])
    # Normal equations, unlike the generator's.
    a = np.stack(known, axis=1)
    left = torque - a @ np.linalg.solve(a.T @ a, a.T @ torque)
    assert rms(left) == pytest.approx(size * case.answer.disturbance, rel=1e-9)


def test_friction_that_is_concealed_whole_has_its_size_and_is_not_known():
    case = drawn("makkar_friction", 1.0)
    (truth,), (m,) = case.answer.truths, case.planned
    law, qd = case.plant.friction[truth.at], m.own[1]
    assert isinstance(law, LuGre)
    assert law.static is not None
    bump = (law.static - law.level) * np.exp(-((qd / law.stribeck_speed) ** 2))
    assert rms((law.level + bump) * np.sign(qd) + law.viscous * qd) == pytest.approx(case.answer.disturbance, rel=1e-9)
    assert f'at = "{truth.at}"' not in case.model
    assert set(truth.also) == {"viscous_friction", "coulomb_friction", "stribeck_friction", "presliding_hysteresis"}


@pytest.mark.parametrize("kind", OUTSIDE)
def test_effects_outside_the_vocabulary_keep_their_size_beside_the_nearest_names(kind):
    case = drawn(kind, 2.0, "outside")
    m, (law,) = case.planned[0], case.plant.laws
    time = m.period * np.arange(len(m.q))
    push = np.array([law(t, q, qd)[m.joint] for t, q, qd in zip(time, m.q, m.qd, strict=True)])
    q, qd, qdd = m.own
    sign = np.sign(qd)
    near = np.stack([time**0, time, q, qd, qdd, sign, qd * abs(qd), abs(m.torque()[:, m.joint]) * sign], axis=1)
    left = push - near @ np.linalg.lstsq(near, push)[0]
    # Friction turns round over 0.03 rad/s in the plant and at once in the sizing.
    assert rms(left) == pytest.approx(2.0 * case.answer.disturbance, rel=0.1)


def test_decoy_shows_most_at_another_joint():
    case = drawn("inertia_error", group="decoy")
    size = shows(case.planned[0], case.hidden[0])
    k = case.planned[0].joint
    assert case.answer.truths[0].at == f"link{k + 1}"
    assert np.argmax(size) != k


def test_wrong_mass_is_linear_in_torque():
    m = drawn("link too light", group="wrong").planned[0]
    one, half = (m.torque(with_mass(m.arm, m.joint, f)) - m.torque() for f in (2.0, 1.5))
    assert half == pytest.approx(0.5 * one, abs=1e-9)


def test_case_is_the_same_each_time():
    one, two = (drawn("torque_ripple", 1.0, number=3) for _ in range(2))
    assert one.answer == two.answer
    assert one.model == two.model
    assert one.answer != drawn("torque_ripple", 1.0, number=4).answer


def test_a_servo_in_a_limit_cycle_is_no_recording(tmp_path):
    """Here joint1 shakes at 300 N·m, ten times what its motion takes; a diagnosis was blamed for what that left."""
    with pytest.raises(ValueError, match="the servo of joint1 rattles"):
        draw(planned_cases(len(ROUND), 90300)[51], 90300, 51, 1).write(tmp_path)
    time = np.arange(5000) / cases.RATE
    noise = 0.5 * np.random.default_rng(0).standard_normal(len(time))
    light = 0.3 * np.sin(2 * np.pi * 0.4 * time) + 0.1 * time  # a wrist, whose noise is stronger than what it carries
    assert not cases.rattles(light + noise, 0.5)
    assert not cases.rattles(light + 0.1 * np.sin(2 * np.pi * 30 * time), 0.02)
    assert cases.rattles(light + 2.0 * np.sin(2 * np.pi * 30 * time), 0.02)


def test_play_under_a_steady_load_is_the_gap_and_the_spring():
    twist = play(np.full(2000, -3.0), 4e-3, 0.2, 500.0, 5.0, 0.02)
    assert twist[-1] == pytest.approx(-3.0 / 500.0 - 0.01, rel=1e-6)


# The plant


def pendulum() -> Arm:
    """One link that turns about its centre of mass: 0.5 kg·m²."""
    return Arm(
        (Link("revolute", np.zeros(3), np.zeros(3), np.eye(3)[2], 2.0, np.zeros(3), 0.5 * np.eye(3), 100.0, 100.0),)
    )


def still(time):
    return np.zeros((len(time), 1)), np.zeros((len(time), 1)), np.zeros((len(time), 1))


def test_law_acts_in_mujoco_as_in_closed_form():
    push, drag, inertia = 2.0, 0.8, 0.5

    def law(time, q, qd):
        return (push - drag * qd * np.abs(qd)) * (time > 0.0)

    plant = ProofPlant(pendulum(), servo=None, laws=(law,))
    found = record(plant, still, 2.0, 250.0, np.random.default_rng(0))
    top = np.sqrt(push / drag)  # v = top·tanh(rate·t), so q = top/rate · ln cosh(rate·t)
    rate = np.sqrt(push * drag) / inertia
    expected = top / rate * np.log(np.cosh(rate * found["time"]))
    # An explicit step of 0.25 ms: half a step of acceleration late at worst.
    assert found["q.joint1"] == pytest.approx(expected, abs=5e-4 * top)


def test_laws_of_one_recording_do_not_outlive_it():
    plant = ProofPlant(pendulum(), servo=None, laws=(lambda time, q, qd: np.ones(1),))
    record(plant, still, 0.1, 250.0, np.random.default_rng(0))
    assert not record(replace(plant, laws=()), still, 0.1, 250.0, np.random.default_rng(0))["q.joint1"].any()


@pytest.fixture(scope="module")
def harness(tmp_path_factory):
    """A case and its folder, recorded."""
    folder = tmp_path_factory.mktemp("case")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cases, "TRAIN", 8.0)
        patch.setattr(cases, "HOLDOUT", 6.0)
        patch.setattr(cases, "THIRD", 6.0)
        patch.setattr(cases, "N_JOINTS", (3,))
        case = drawn("harness_stiffness", 4.0, number=1)
        case.write(folder)
    return case, folder


def test_floor_is_what_the_true_dynamics_leave_of_a_recording():
    case = drawn("sensor_bias", number=2)
    plant = replace(case.plant, friction={}, tau_bias={}, encoder_step={})
    seconds, rng = 6.0, np.random.default_rng(4)
    lowest = floor(plant, seconds, 250.0, rng)
    found = record(plant, case.motions[0], seconds, 250.0, rng)
    q = np.column_stack([found[f"q.{j}"] for j in plant.arm.joints])
    spline = make_interp_spline(found["time"], q, k=5)
    model = mujoco.MjModel.from_xml_string(plant.arm.mjcf())  # pyright: ignore[reportAttributeAccessIssue]
    data = mujoco.MjData(model)  # pyright: ignore[reportAttributeAccessIssue]
    left = np.column_stack([found[f"tau.{j}"] for j in plant.arm.joints])
    for k, t in enumerate(found["time"]):
        data.qpos[:], data.qvel[:], data.qacc[:] = spline(t), spline(t, 1), spline(t, 2)
        mujoco.mj_inverse(model, data)  # pyright: ignore[reportAttributeAccessIssue]
        left[k] -= data.qfrc_inverse
    inside = slice(50, -50)  # a spline's ends
    assert band_rms((left - lowest)[inside], 250.0, 20.0) == pytest.approx(0.0, abs=0.1 * case.answer.disturbance)
    assert band_rms(lowest, 250.0, 125.0) == pytest.approx(np.sqrt(np.mean(lowest**2, axis=0)))


# The third recording


def test_gain_is_of_the_recording_that_nothing_was_given(harness, tmp_path):
    """The spring with its true stiffness against none: what is left is disturbance and noise, as the floor says."""
    case, folder = harness
    (truth,) = case.answer.truths
    text = (folder / "arm.toml").read_text()
    named = text.replace("effects = [", f'effects = [{{name = "harness_stiffness", at = "{truth.at}"}}, ')
    assert named != text
    (folder / "named.toml").write_text(named)
    (channel,) = case.answer.channels
    lowest = float(np.interp(20.0, cases.BANDS, case.answer.floor[channel]))
    before, after = (left(folder, folder / f"{n}.toml", 20.0, refit=True)[channel] for n in ("arm", "named"))
    assert before > 2.0 * lowest
    assert after == pytest.approx(lowest, rel=0.25)
    blind = tmp_path / "blind"
    shutil.copytree(folder, blind)
    (blind / "hold.csv").unlink()
    assert left(blind, folder / "named.toml", 20.0, refit=True)[channel] == after


def test_a_third_recording_changes_nothing_of_the_two_before(harness):
    """Drawn last: motions and noise of seeds that were run before are what they were."""
    _, folder = harness
    assert {p.name for p in folder.glob("*.csv")} == set(cases.RECORDINGS)
    found = [rms(np.loadtxt(folder / name, delimiter=",", skiprows=1)[:, 1:]) for name in cases.RECORDINGS[:2]]
    assert found == pytest.approx([22.19298, 29.04359], rel=1e-3)  # of the generator that made two


# The oracle


def test_twin_conceals_nothing_and_has_the_same_noise():
    case = drawn("sensor_drift", 4.0)
    m, drift = case.planned[0], case.plant.tau_drift[case.planned[0].name]
    with_it, without_it = (
        record(p, case.motions[1], 3.0, 250.0, copy.deepcopy(case.noise[1])) for p in (case.plant, case.twin)
    )
    # The drift is in the torque channel alone: nothing else differs, and that by its closed form.
    for name, values in with_it.items():
        grown = drift.final * (1.0 - np.exp(-with_it["time"] / drift.time_constant)) if name == f"tau.{m.name}" else 0.0
        assert values - without_it[name] == pytest.approx(grown, abs=1e-9)
    whole = drawn("makkar_friction")
    at = f'at = "{whole.answer.truths[0].at}"'
    assert at not in whole.model
    assert whole.twin_model.count(at) == len(FRICTION)  # which the twin's model knows everywhere


def test_oracle_leaves_about_its_floor(monkeypatch):
    """MuJoCo's arm against the tool's fit of it: within a fifth of disturbance and noise, where no bristle shows."""
    monkeypatch.setattr(cases, "N_JOINTS", (3,))
    monkeypatch.setattr(cases, "TRAIN", 10.0)
    plan = ("single", ("harness_stiffness",), 4.0)
    (left,) = oracle.run(oracle.Wanted(plan, SEED, 1, 0, (20.0,)))["over_floor"]
    assert set(left) == {"tau.joint1", "tau.joint2", "tau.joint3"}
    assert all(0.8 < x < 1.2 for x in left.values()), left
    assert oracle.run(oracle.Wanted(plan, SEED, 0, 0, ())) == {"over_floor": []}


def test_no_oracle_where_the_twin_cannot_be_recorded(monkeypatch):
    monkeypatch.setattr(cases, "MOST_ASTRAY", 0.0)
    monkeypatch.setattr(cases, "TRAIN", 1.0)
    found = oracle.run(oracle.Wanted(("single", ("harness_stiffness",), 4.0), SEED, 0, 0, (20.0, 8.0)))
    assert found["over_floor"] == [{}, {}]
    assert "strays" in found["none"]


# Rivals


@pytest.mark.slow
def test_rivals_answer_in_the_same_form(harness):
    case, folder = harness
    found = rivals.run(folder)
    best = found["joint_bic"]["effects"][0]
    assert best["name"] == "harness_stiffness"
    assert best["at"] == case.answer.truths[0].at
    for name in rivals.NAMES:
        judged = judge(case.answer, found[name])
        assert judged.error is not None
        before, after = judged.error
        assert judged.answer.channels == (f"tau.{case.planned[0].name}",)
        assert before > 2.0  # 4 times the disturbance, on top of it
        assert after < before or name != "joint_bic"
    assert found["gaussian_process"]["verdict"] == "none"


# The page in docs/


def test_documentation_counts_the_cases_as_the_plan_does():
    text = (Path(__file__).resolve().parents[2] / "docs" / "proof.md").read_text(encoding="utf-8")
    told = dict(re.findall(r"^\| (\w+) \| (\d+) \|", text, re.MULTILINE))
    assert {name: int(count) for name, count in told.items()} == Counter(group for group, _, _ in ROUND)
    assert f"A round is {len(ROUND)} cases" in text
    assert f"--cases {len(ROUND)} --workers 2 --seed {run.SEED}" in text
