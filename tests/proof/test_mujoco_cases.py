"""Cases of the first generator for registered runs: the same arms, and a truth that the second's judge reads."""

import json

import numpy as np
import pytest

from proof.cases import ROUND, draw, planned_cases
from proof.concealed import VALUES
from proof.drives.cases import LAWLESS
from proof.drives.judge import judge
from proof.mujoco.make import MASSES, make, planned, truth

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
    count = 1 + next(k for k, (g, _, _) in enumerate(planned_cases(40, SEED)) if g == "single")
    (path,) = make(tmp_path, SEED, count, "single", tell=lambda _: None)[-1:]
    files = {x.name for x in path.iterdir()}
    assert files == {"arm.toml", "arm.urdf", "train.csv", "hold.csv", "third.csv", "truth.json", "twin"}
    # What is concealed is all that the twin lacks; motion, noise and disturbance are the same.
    own, twin = (load(path / name / "third.csv") for name in ("", "twin"))
    assert np.array_equal(own["time"], twin["time"])
    apart = {c: float(np.std(own[c] - twin[c])) for c in own if c.startswith("tau.")}
    assert max(apart, key=lambda c: apart[c]) == told_of(path)["effects"][0]["channel"]
    assert min(apart.values()) < 0.1 * max(apart.values())
    told = json.loads((path / "truth.json").read_text())
    assert [(e["law"], e["size"]) for e in told["effects"]] == list(planned(SEED, count)[-1].concealed)
    before = np.loadtxt(path / "hold.csv", delimiter=",", skiprows=1)
    make(tmp_path, SEED, count, "single", tell=lambda _: None)
    np.testing.assert_array_equal(before, np.loadtxt(path / "hold.csv", delimiter=",", skiprows=1))
    with pytest.raises(ValueError, match="holds cases of seed"):
        make(tmp_path, SEED + 1, count, tell=lambda _: None)
