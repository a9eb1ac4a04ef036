"""Constants of drives, concealed in another engine's recordings and identified beside friction."""

import numpy as np
import pytest
from driven_arm import EFFECTS, LEVEL, VISCOUS, model_file, recorded, speed

import snarelab
from snarelab.errors import InputError
from snarelab.models.model_file import load_model

GAINS = {"joint1": 0.124, "joint2": 0.068, "joint3": -0.039}
STIFFNESS, DAMPING = 85.0, 6.5


@pytest.fixture(scope="module")
def currents(tmp_path_factory):
    """Currents [A] in place of torques, the third with the drive's sign reversed."""
    folder = tmp_path_factory.mktemp("currents")
    joints, tables = recorded(folder)
    for name, table in zip(("train", "holdout"), tables, strict=True):
        for j in joints:
            table[f"current.{j} [A]"] = table.pop(f"tau.{j}") / GAINS[j]
        table.to_csv(folder / f"{name}.csv", index=False)
    free = "".join(f'"tau.{j}" = {{ column = "current.{j}", gain = "free" }}\n' for j in joints)
    return folder, model_file(folder, f"[signals]\n{free}")


@pytest.fixture(scope="module")
def found(currents):
    folder, model = currents
    return snarelab.identify(model, folder / "train.csv", holdout=folder / "holdout.csv")


def test_a_concealed_constant_is_found_to_within_two_deviations(found):
    gains = {p.at: p for p in found.parameters if p.effect == "gain"}
    assert set(gains) == {f"tau.{j}" for j in GAINS}
    for joint, true in GAINS.items():
        p = gains[f"tau.{joint}"]
        assert (p.name, p.unit) == ("gain", "N*m/A")
        assert abs(p.value - true) < 2 * p.std < 0.04 * abs(true)
    levels = [p for p in found.parameters if p.effect == "coulomb_friction"]
    assert [p.value for p in levels] == pytest.approx(3 * [LEVEL], rel=0.03)
    # What is left is the arm's disturbance, up to a seventh of the lightest joints' torque.
    assert all(found.fit[f"tau.{j}"]["holdout"]["relative"] < 0.15 for j in GAINS)


def test_what_a_constant_rests_on_is_said(found):
    (note,) = [x for x in found.published["notes"] if x.startswith("gain at tau.joint2: ")]
    assert "rests on the model's masses" in note
    assert "larger by the same" in note


def test_a_constant_stands_as_a_number_in_the_saved_model(found, currents):
    folder, _ = currents
    found.save_model(folder / "saved.toml")
    text = (folder / "saved.toml").read_text()
    assert "free" not in text
    assert "nominal" not in text
    saved = load_model(folder / "saved.toml")
    gains = {p.at: p.value for p in found.parameters if p.effect == "gain"}
    assert {name: s.gain for name, s in saved.signals.items()} == pytest.approx(gains)
    assert {p.effect.name for p in saved.effects} == set(EFFECTS)
    again = snarelab.identify(saved, folder / "train.csv")
    assert again.fit["tau.joint1"]["train"]["relative"] == pytest.approx(
        found.fit["tau.joint1"]["train"]["relative"], rel=1e-3
    )
    run = snarelab.simulate(saved, folder / "holdout.csv")
    assert run["tau.joint1"].std() > 10 * LEVEL  # torques, not currents


@pytest.mark.slow
def test_physics_is_named_beside_a_constant_that_nobody_knows(currents):
    folder, _ = currents
    lines = "[signals]\n" + "".join(f'"tau.{j}" = {{ column = "current.{j}", gain = "free" }}\n' for j in GAINS)
    poor = model_file(folder, lines, ["viscous_friction"], "poor.toml")
    answer = snarelab.diagnose(poor, folder / "train.csv", holdout=folder / "holdout.csv")
    assert answer.checks == ()
    assert {e.at for e in answer.effects if e.name == "coulomb_friction"} >= {"joint2", "joint3"}
    assert answer.steps[-1].holdout < 0.7 * answer.steps[0].holdout
    assert {s.gain for s in answer.model.signals.values()} == {s.gain for s in answer.model.signals.values()} - {"free"}
    gain = answer.model.signals["tau.joint1"].gain
    assert isinstance(gain, float)
    assert gain == pytest.approx(GAINS["joint1"], rel=0.01)
    assert "gain.tau.joint1.gain" in {m["name"] for m in answer.to_json()["moved"]}


def test_one_known_constant_tells_the_others_where_masses_are_free(currents):
    folder, _ = currents
    known = GAINS["joint1"]
    lines = f'inertia = "free"\n[signals]\n"tau.joint1" = {{ column = "current.joint1", gain = {known} }}\n' + "".join(
        f'"tau.{j}" = {{ column = "current.{j}", gain = "free" }}\n' for j in ("joint2", "joint3")
    )
    result = snarelab.identify(model_file(folder, lines, name="masses.toml"), folder / "train.csv")
    p = next(p for p in result.parameters if p.effect == "gain" and p.at == "tau.joint2")
    assert p.std is not None
    assert abs(p.value - GAINS["joint2"]) < 3 * p.std
    assert any("rests on the other torques" in note for note in result.published["notes"])


@pytest.fixture(scope="module")
def commands(tmp_path_factory):
    """What a position servo must have been asked for, so that it gave the torque recorded."""
    folder = tmp_path_factory.mktemp("commands")
    joints, tables = recorded(folder)
    for name, table in zip(("train", "holdout"), tables, strict=True):
        for j in joints:
            given = table.pop(f"tau.{j}") + DAMPING * speed(table, j)
            table[f"command.{j} [deg]"] = np.degrees(table[f"q.{j}"] + given / STIFFNESS)
        table.to_csv(folder / f"{name}.csv", index=False)
    return folder, joints


def servos(joints, damping):
    gains = f'stiffness = "free", damping = {damping}'
    return "[servo]\n" + "".join(f'"{j}" = {{ kind = "position", {gains} }}\n' for j in joints)


def test_a_servo_is_identified_from_command_and_encoder(commands):
    folder, joints = commands
    model = model_file(folder, servos(joints, '"free"'), ["coulomb_friction"], "servo.toml")
    result = snarelab.identify(model, folder / "train.csv")
    values = {(p.at, p.name): p for p in result.parameters if p.effect == "servo"}
    assert len(values) == 2 * len(joints)
    for j in joints:
        stiffness, damping = values[j, "stiffness"], values[j, "damping"]
        assert stiffness.std is not None
        assert (stiffness.unit, damping.unit) == ("N*m/rad", "N*m*s/rad")
        assert abs(stiffness.value - STIFFNESS) < 2.5 * stiffness.std < 0.05 * STIFFNESS
        assert damping.value == pytest.approx(DAMPING + VISCOUS, rel=0.05)  # the joint's own cannot be told from it
    result.save_model(folder / "known.toml")
    saved = load_model(folder / "known.toml")
    assert saved.servo["joint1"].stiffness == pytest.approx(values["joint1", "stiffness"].value)
    assert saved.servo["joint1"].damping == pytest.approx(values["joint1", "damping"].value)
    again = snarelab.identify(saved, folder / "holdout.csv")
    assert not [p for p in again.parameters if p.effect == "servo"]
    assert again.fit["tau.joint1"]["train"]["relative"] < 0.05


def test_damping_beside_viscous_friction_is_one_sum_and_said(commands):
    folder, joints = commands
    model = model_file(folder, servos(joints, '"free"'), EFFECTS, "both.toml")
    result = snarelab.identify(model, folder / "train.csv")
    viscous = [p for p in result.parameters if p.effect == "viscous_friction"]
    assert [p.value for p in viscous] == pytest.approx(3 * [DAMPING + VISCOUS], rel=0.05)
    assert sum("damping and viscous friction" in note for note in result.published["notes"]) == 3


def test_a_known_damping_leaves_the_joint_its_own_friction(commands):
    folder, joints = commands
    model = model_file(folder, servos(joints, DAMPING), EFFECTS, "damped.toml")
    result = snarelab.identify(model, folder / "train.csv")
    viscous = [p for p in result.parameters if p.effect == "viscous_friction"]
    assert [p.value for p in viscous] == pytest.approx(3 * [VISCOUS], rel=0.15)


MISTAKES = [
    ('[signals]\n"q.joint1" = { column = "q.joint1", gain = "free" }', "only a torque's constant can be identified"),
    (
        'inertia = "free"\n[signals]\n' + "".join(f'"tau.{j}" = {{ column = "i", gain = "free" }}\n' for j in GAINS),
        "give one constant as a number",
    ),
    ("[servo]\njoint9 = { kind = 'position' }", "'joint9' is no joint that moves here"),
    ("[servo]\njoint1 = { kind = 'torque' }", "allowed is { kind = 'position'"),
    ("[servo]\njoint1 = { kind = 'position', gain = 3 }", "has 'gain'; allowed are kind, stiffness, damping"),
    ("[servo]\njoint1 = { kind = 'position', stiffness = 0 }", "allowed is a number above 0, or 'free'"),
    ("[servo]\njoint1 = { kind = 'position', damping = -1 }", "allowed is a number of 0 or more, or 'free'"),
    ("[servo]\njoint1 = { kind = 'position', damping = nan }", "allowed is a number of 0 or more, or 'free'"),
    ('[signals]\n"tau.joint1" = "i"\n[servo]\njoint1 = { kind = "position" }', "keep one of them"),
]


@pytest.mark.parametrize(("lines", "said"), MISTAKES)
def test_wrong_constants_are_refused_in_one_line(currents, lines, said):
    folder, _ = currents
    with pytest.raises(InputError) as error:
        load_model(model_file(folder, lines, name="wrong.toml"))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_gain_that_is_an_effect_too_is_refused(currents):
    folder, _ = currents
    line = '[signals]\n"tau.joint1" = { column = "current.joint1", gain = "free" }'
    with pytest.raises(InputError, match="free already; keep one"):
        load_model(model_file(folder, line, ["sensor_gain"], "wrong.toml"))


def test_a_servo_without_its_command_asks_for_it(currents):
    folder, _ = currents
    model = model_file(folder, "[servo]\njoint1 = { kind = 'position' }", name="no_command.toml")
    with pytest.raises(InputError, match=r"no signal 'command\.joint1'.*map it under \[signals\]"):
        snarelab.identify(model, folder / "train.csv")


def test_a_constant_that_no_motion_tells_is_asked_for(tmp_path):
    _, (table,) = recorded(tmp_path, "a", 6.0)
    table["tau.joint1"] = 0.0
    table.to_csv(tmp_path / "run.csv", index=False)
    model = model_file(tmp_path, '[signals]\n"tau.joint1" = { column = "tau.joint1", gain = "free" }')
    with pytest.raises(InputError, match=r"constant of tau\.joint1 is free.*write the constant as a number"):
        snarelab.identify(model, tmp_path / "run.csv")
