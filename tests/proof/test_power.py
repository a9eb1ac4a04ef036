"""Power about the stated limit: of a tool made by hand, which sees what is larger than some value and no less."""

import json

import numpy as np
import pytest
from proof_answers import finding

from proof import cases, power
from proof.concealed import VALUES
from proof.pictures import power as picture

SEED, LIMIT = 90701, 0.02
KINDS = ("quadratic_friction", "sensor_bias")


@pytest.fixture
def short(monkeypatch):
    for name in ("TRAIN", "HOLDOUT", "THIRD"):
        monkeypatch.setattr(cases, name, 2.0)
    monkeypatch.setattr(cases, "N_JOINTS", (3,))
    # The recordings are not looked at here: an arm that cannot be followed for two seconds is no matter.
    monkeypatch.setattr(cases.Case, "write", lambda case, folder: WRITTEN.append(case))
    WRITTEN.clear()


WRITTEN: list = []


def sees(threshold):
    """A tool that states `LIMIT`, sees what is larger than ``threshold`` times it, and names it from 1.2 of that on."""

    def run(folder):
        case = WRITTEN[-1]
        told = {"fit": {}, "third": {}, "band": {"value": 20.0}, "candidates": []}
        if case.plant is case.twin:
            truth = case.answer.truths[0]
            limits = [{"name": truth.name, "at": truth.at, "parameter": VALUES[truth.name], "value": LIMIT, "unit": ""}]
            return told | {"verdict": "adequate", "effects": [], "limits": limits}
        own, truth = abs(case.answer.value[0]) / LIMIT, case.answer.truths[0]
        named = [finding(truth.name, truth.at)] if own > 1.2 * threshold else []
        verdict = "missing_physics" if named else "unknown_effect" if own > threshold else "adequate"
        return told | {"verdict": verdict, "effects": named, "limits": []}

    return run


def test_effects_are_concealed_at_multiples_of_what_was_stated(short, tmp_path):
    told = []
    every = power.run_on(tmp_path, SEED, 2, sees(0.9), told.append, kinds=KINDS)
    assert len(told) == 2 * len(KINDS)
    assert {x["ratio"] for x in every} == set(power.RATIOS)
    by_ratio = {r["ratio"]: r for r in power.result(every)["effects"]["all"]}
    assert by_ratio[1.0]["cases"] == 4
    assert {k: (r["seen"], r["named"]) for k, r in by_ratio.items()} == {
        0.4: (0.0, 0.0),
        0.6: (0.0, 0.0),
        0.8: (0.0, 0.0),
        1.0: (1.0, 0.0),
        1.4: (1.0, 1.0),
        2.0: (1.0, 1.0),
    }
    assert by_ratio[1.4]["named_interval"] == pytest.approx([0.025**0.25, 1.0])  # of 4 of 4, by hand
    # The same arm, motions and noise at every size.
    arms = [c for c in WRITTEN if c.answer.kinds == ("sensor_bias",)][: len(power.RATIOS) + 1]
    assert len({c.answer.joints for c in arms}) == 1
    assert np.ptp([c.motions[2](np.linspace(0.0, 2.0, 5))[0] for c in arms], axis=0).max() == 0.0
    # What is done is not done again.
    count = len(WRITTEN)
    assert power.run_on(tmp_path, SEED, 2, sees(0.9), told.append, kinds=KINDS) == every
    assert len(WRITTEN) == count
    assert b"by its name" in picture(power.result(every)) or b"<svg" in picture(power.result(every))


def test_what_cannot_be_tried_is_counted_by_its_reason(short, tmp_path):
    def silent(folder):
        return {"verdict": "adequate", "effects": [], "limits": []}

    (line,) = power.lines("sensor_bias", SEED, 0, tmp_path, silent)
    assert line["ratio"] is None
    found = power.result([line])
    assert found["effects"] == {}
    assert json.loads(json.dumps(found))["untried"] == {"sensor_bias: no limit of its value was stated": 1}


def test_arm_of_a_size_that_hardware_does_not_have(short, tmp_path):
    attempt, _ = power.base("sensor_bias", SEED, 0, tmp_path)
    with pytest.raises(power.NoLimit, match="hardware has none"):
        power.sized("sensor_bias", SEED, 0, attempt, 1e9)


def test_arm_that_strays_is_drawn_again(short, monkeypatch, tmp_path):
    """Two attempts that cannot be recorded, then one that can: its arm is that of every size."""
    left = [ValueError("strays"), ValueError("strays")]

    def write(case, folder):
        if left:
            raise left.pop()
        WRITTEN.append(case)

    monkeypatch.setattr(cases.Case, "write", write)
    attempt, case = power.base("sensor_bias", SEED, 0, tmp_path)
    plan = ("single", ("sensor_bias",), 1.0)
    possible = [k for k in range(attempt + 1) if cases.planned_case(plan, SEED, 0, k) is not None]
    assert len(possible) == 3
    assert possible[-1] == attempt
    assert WRITTEN[-1].plant is case.twin
    assert power.sized("sensor_bias", SEED, 0, attempt, 0.1).answer.joints == case.answer.joints
