"""The machines' bench: a run that was broken off goes on, what a name counts as, and the table."""

import json

import numpy as np
import pytest

from bench import machine_case, machines
from bench.machine_case import OUTCOMES, SIZE, draw, outcome
from bench.machine_effects import ENTRIES
from snarelab.errors import InputError


def effect(name, at, *others):
    return {"name": name, "at": at, "class": [list(x) for x in others]}


GEAR = (("gear_efficiency", "joint2"),)
BOTH = (("coulomb_friction", "motor_a"), ("coulomb_friction", "motor_b"))


@pytest.mark.parametrize(
    ("truths", "named", "expected"),
    [
        (GEAR, [effect(*GEAR[0])], "alone"),
        (GEAR, [effect("sensor_gain", "tau.joint2", GEAR[0])], "in class"),
        (GEAR, [effect(*GEAR[0]), effect("backlash", "joint1")], "among others"),
        (GEAR, [effect("gear_efficiency", "joint1")], "elsewhere"),
        (GEAR, [effect("sensor_gain", "tau.joint2")], "wrong"),
        (GEAR, [], "nothing"),
        (BOTH, [effect(*x) for x in BOTH[::-1]], "alone"),
        (BOTH, [effect(*BOTH[0])], "among others"),
        (BOTH, [effect("x", "y", *BOTH), effect(*BOTH[0])], "in class"),
        (BOTH, [effect("x", "y"), effect(*BOTH[0], BOTH[1])], "among others"),
        ((), [effect("backlash", "joint1")], "wrong"),
        ((), [], "nothing"),
    ],
)
def test_what_a_name_counts_as(truths, named, expected):
    assert outcome(truths, named) == expected


def row(entry, seed, found, told=()):
    return {
        "effect": entry, "seed": seed, "outcome": found, "verdict": "adequate", "truths": [], "named": list(told),
        "seconds": 1.0,
    }  # fmt: skip


def test_cases_that_are_done_are_not_done_again(tmp_path, monkeypatch, capsys):
    made = []

    def run_case(entry, seed, folder):
        if (entry, seed) == ("clean", 2):
            raise KeyboardInterrupt
        made.append((entry, seed))
        return row(entry, seed, "nothing")

    monkeypatch.setattr(machines, "run_case", run_case)
    words = ["--seeds", "1-2", "--effects", "gear_efficiency,clean", "--out", str(tmp_path / "new" / "x.jsonl")]
    assert machines.main(words) == 130
    assert "goes on" in capsys.readouterr().err
    assert made == [("gear_efficiency", 1), ("clean", 1), ("gear_efficiency", 2)]
    monkeypatch.setattr(machines, "run_case", lambda e, s, f: made.append((e, s)) or row(e, s, "wrong"))
    assert machines.main(words) == 0
    assert made[3:] == [("clean", 2)]
    lines = (tmp_path / "new" / "x.jsonl").read_text().splitlines()
    assert [json.loads(x)["seed"] for x in lines] == [1, 1, 2, 2]


def test_the_table_counts_outcomes_by_entry():
    """A clean case is right where nothing is named, any other where its name stands alone."""
    rows = [row("gear_efficiency", k, o) for k, o in enumerate(["alone", "alone", "in class", "nothing"])]
    rows += [row("clean", k, o) for k, o in enumerate(["nothing", "nothing", "wrong"])]
    head, *body = machines.table(rows).splitlines()
    assert all(o in head for o in OUTCOMES)
    assert [x.split() for x in body] == [
        ["gear_efficiency", "2", "1", "0", "0", "0", "1", "4", "2"],
        ["clean", "0", "0", "0", "0", "1", "2", "3", "2"],
    ]


def test_a_last_line_that_was_broken_off_is_dropped_and_other_faults_are_told(tmp_path, capsys):
    path = tmp_path / "x.jsonl"
    path.write_text('{"effect": "clean", "seed": 1}\n{"effect": "cl')
    assert machines.done(path) == [{"effect": "clean", "seed": 1}]
    assert path.read_text() == '{"effect": "clean", "seed": 1}\n'
    path.write_text("no JSON\n{}\n")
    assert machines.main(["--out", str(path)]) == 2
    assert f"{path}, line 1" in capsys.readouterr().err


def test_seeds_and_effects_as_they_are_typed():
    assert machines.seeds_of("1-3,7") == [1, 2, 3, 7]
    assert machines.entries_of("heating_friction,clean") == ["heating_friction", "heating_friction.recorded", "clean"]
    for text in ("x", "3-", "1,,2", "-2"):
        with pytest.raises(InputError, match="--seeds"):
            machines.seeds_of(text)
    with pytest.raises(InputError, match="did you mean 'joint_spring'"):
        machines.entries_of("joint_sprung")


def test_an_entry_is_listed_where_the_vocabulary_has_its_name():
    assert ENTRIES["gear_efficiency"].listed
    assert not machine_case.ENTRIES["gear_efficiency"].__class__(("no_such_effect",), ENTRIES["clean"].make).listed


@pytest.mark.parametrize("entry", ["joint_spring", "torque_ripple", "wrist.inertia"])
def test_what_is_concealed_is_twice_the_disturbance_beside_known_friction(entry):
    """By the torque that another run of MuJoCo's inverse dynamics needs, or the part's own law."""
    case = next(c for c in (attempt(entry, k) for k in range(50)) if c)
    states = case.motions[0](np.arange(0.0, machine_case.TRAIN, 1.0 / machine_case.RATE))
    left = []
    for k, torque in enumerate(needed(case, states).T):
        columns = np.stack([np.sign(states[1][:, k]), states[1][:, k]], axis=1)
        left.append(np.sqrt(np.mean((torque - columns @ np.linalg.lstsq(columns, torque)[0]) ** 2)))
    assert max(left) == pytest.approx(SIZE * case.rms, rel=1e-6)


def attempt(entry, k):
    try:
        return draw(entry, 1, k)
    except ValueError:
        return None


def needed(case, states):
    """Torque (n_samples, n_joints) that the plant needs beyond its arm's."""
    import mujoco

    found = np.zeros_like(states[0])
    for sign, ties in ((1.0, case.plant.ties), (-1.0, ())):
        plant = case.plant.__class__(case.plant.arm, ties=ties)
        model = plant.model(2.5e-4)
        data = mujoco.MjData(model)  # pyright: ignore[reportAttributeAccessIssue]
        for k, (data.qpos[:], data.qvel[:], data.qacc[:]) in enumerate(zip(*states, strict=True)):
            mujoco.mj_inverse(model, data)  # pyright: ignore[reportAttributeAccessIssue]
            found[k] += sign * data.qfrc_inverse
    for law in case.plant.mechanisms:
        j = case.plant.arm.joints.index(law.joint)
        found[:, j] -= [law.torque(q, qd) for q, qd in zip(states[0][:, j], states[1][:, j], strict=True)]
    return found
