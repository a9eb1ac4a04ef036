"""Cases of the first generator for registered runs: the same arms, and a truth that the second's judge reads."""

import json
from collections import Counter

import numpy as np
import pytest

from bench.mujoco_plant import _disturbance
from proof.cases import ROUND, draw
from proof.concealed import VALUES
from proof.drives.cases import CLEAN, FAULTY, LAWLESS, PAIR, SINGLE
from proof.drives.judge import judge
from proof.mujoco.deck import DECK, KINDS, SPRINGS, Plan, planned
from proof.mujoco.faults import FAULTS
from proof.mujoco.make import MASSES, make, truth, write
from proof.mujoco.world import World

SEED = 90500


def answer_of(group, kind="coulomb_friction"):
    kinds = next(k for g, k, _ in ROUND if g == group and (group != "single" or kind in k))
    return draw((group, kinds, 2.0), SEED, 0, 0).answer


def told_of(path):
    return json.loads((path / "truth.json").read_text())


def load(path):
    names = path.read_text().splitlines()[0].split(",")
    return dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1).T, strict=True))


def said(truth, *named, verdict="missing_physics"):
    effects = [{"name": n, "at": at, "probability": 0.9, "rivals": [], "parameters": {}} for n, at in named]
    return {"verdict": verdict, "effects": effects, "seconds": 1.0, "location": {}, "truth": truth}


def test_single_effect_is_right_at_its_place_and_compared_by_its_value():
    answer = answer_of("single")
    told = truth(answer, SEED)
    (effect,) = told["effects"]
    assert effect["values"] == {VALUES["coulomb_friction"]: answer.value[0]}
    line = said(told, ("coulomb_friction", answer.truths[0].at))
    line["effects"][0]["parameters"] = {VALUES["coulomb_friction"]: {"value": answer.value[0] + 0.2, "std": 0.1}}
    (found,) = judge(line).found
    assert found.placed
    assert found.deviations == pytest.approx((2.0,))


def test_law_outside_the_vocabulary_is_one_without_a_name():
    told = truth(answer_of("outside"), SEED)
    assert told["group"] == LAWLESS
    assert judge(said(told, verdict="unknown_effect")).unknown
    assert len(judge(said(told, ("coulomb_friction", "joint1"))).wrong) == 1


def test_wrong_mass_of_a_link_is_a_mass_and_no_physics():
    told = truth(answer_of("wrong"), SEED)
    assert told["effects"] == []
    assert judge(said(told, *((name, "link1") for name in MASSES))).wrong == []
    assert len(judge(said(told, ("torque_ripple", "joint1"))).wrong) == 1


def test_cases_are_those_of_the_plan_and_are_made_once(tmp_path):
    count = 1 + next(k for k, plan in enumerate(planned(SEED, 40)) if plan.group == SINGLE)
    (path,) = make(tmp_path, SEED, count, "single", tell=lambda _: None)[-1:]
    files = {x.name for x in path.iterdir()}
    assert files == {"arm.toml", "arm.urdf", "train.csv", "hold.csv", "third.csv", "truth.json", "twin"}
    # What is concealed is all that the twin lacks; motion, noise and disturbance are the same.
    own, twin = (load(path / name / "third.csv") for name in ("", "twin"))
    assert np.array_equal(own["time"], twin["time"])
    apart = {c: float(np.std(own[c] - twin[c])) for c in own if c.startswith("tau.")}
    # A link's inertia is sized along the planned motion, and nearly as large at a neighbour.
    assert apart[told_of(path)["effects"][0]["channel"]] > 0.7 * max(apart.values())
    told = json.loads((path / "truth.json").read_text())
    assert [(e["law"], e["size"]) for e in told["effects"]] == list(planned(SEED, count)[-1].concealed)
    before = np.loadtxt(path / "hold.csv", delimiter=",", skiprows=1)
    make(tmp_path, SEED, count, "single", tell=lambda _: None)
    np.testing.assert_array_equal(before, np.loadtxt(path / "hold.csv", delimiter=",", skiprows=1))
    with pytest.raises(ValueError, match="holds cases of seed"):
        make(tmp_path, SEED + 1, count, tell=lambda _: None)


def test_plan_has_its_shares_and_goes_on_as_it_began():
    plans = planned(SEED, 100)
    assert Counter(p.group for p in plans) == {group: 2 * DECK.count(group) for group in set(DECK)}
    assert plans[:9] == planned(SEED, 9)
    assert planned(SEED + 1, 9) != plans[:9]
    filled = [p for p in plans if p.group != CLEAN]
    several = [p for p in filled if p.group == PAIR]
    assert len(several) >= len(filled) / 3 - 1
    assert {len(p.concealed) for p in several} == {2, 3, 4}
    assert all(len({name for name, _ in p.concealed} & set(SPRINGS)) <= 1 for p in several)
    clean = Counter(p.disturbance for p in plans if p.group == CLEAN)
    assert max(clean.values()) - min(clean.values()) <= 1
    assert set(clean) == set(KINDS)


@pytest.fixture(scope="module")
def case():
    return draw(("clean", (), 0.0), SEED, 1, 0)


def world_of(case, kind="white"):
    return World.random(case, kind, np.random.default_rng(3))


def test_urdf_is_off_by_one_to_five_per_cent_and_the_servo_believes_it(case):
    world = world_of(case)
    made = world.of(case.plant)
    assert made.arm is case.plant.arm
    assert made.real is not None
    for real, told in zip(made.real.links, made.arm.links, strict=True):
        off = np.array([real.mass / told.mass, real.inertia[0, 0] / told.inertia[0, 0], *(real.com / told.com)])
        assert np.all((np.abs(off - 1.0) > 0.0099) & (np.abs(off - 1.0) < 0.0501))


def test_disturbances_are_as_large_and_as_slow_as_they_are_called(case):
    slow = {}
    for kind in KINDS:
        plant = world_of(case, kind).of(case.plant)
        pushed = _disturbance(plant, np.random.default_rng(4), 20000)
        assert np.sqrt(np.mean(pushed**2, axis=0)) == pytest.approx(case.answer.disturbance)
        slow[kind] = float(np.median(np.mean(np.diff(pushed, axis=0) ** 2, axis=0)))
    assert slow["white"] > 4.0 * slow["coloured"] > 16.0 * slow["wandering"]


def test_logged_encoder_counts_and_clock_jitters(case):
    world = world_of(case)
    time = np.arange(2000) / 250.0
    seen = world.logged("train.csv", {"time": time, "q.joint1": np.sin(time), "tau.joint1": np.cos(time)})
    counts = seen["q.joint1"] * 2.0**world.bits / (2.0 * np.pi)
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    assert np.std(seen["q.joint1"] - np.sin(time)) < 2.0 * 2.0 * np.pi / 2.0**world.bits
    assert np.std(np.diff(seen["time"]) * 250.0) == pytest.approx(np.sqrt(2.0) * world.jitter, rel=0.1)
    np.testing.assert_array_equal(seen["tau.joint1"], np.cos(time))
    other = world.logged("third.csv", {"time": time, "q.joint1": np.sin(time), "tau.joint1": np.cos(time)})
    assert abs(np.corrcoef(np.diff(seen["time"]), np.diff(other["time"]))[0, 1]) < 0.1


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_changes_the_channels_of_two_joints_at_most(case, fault):
    world = world_of(case)
    time = np.arange(2000) / 250.0
    columns = {f"{x}.joint{k + 1}": np.sin((k + 2) * time + len(x)) for x in ("q", "tau") for k in range(3)}
    sound, broken = (world.logged("hold.csv", {"time": time, **columns}, name) for name in ("", fault))
    changed = {name for name, x in broken.items() if not np.array_equal(x, sound[name])}
    assert 1 <= len(changed) <= 4
    assert len({name.split(".")[1] for name in changed}) <= 2


def test_a_recording_at_fault_conceals_nothing(tmp_path):
    write(Plan(FAULTY, (("one torque in N·mm", 0.0),)), SEED, 3, tmp_path / "case")
    told = told_of(tmp_path / "case")
    assert told["group"] == FAULTY
    assert told["fault"] == "one torque in N·mm"
    assert told["effects"] == []
    torque = load(tmp_path / "case" / "train.csv")
    size = sorted(np.std(x) for name, x in torque.items() if name.startswith("tau."))
    assert size[-1] > 20.0 * size[-2]
