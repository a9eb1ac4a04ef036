"""Joints that move, joints that are held, and joints that nobody recorded: model files and recordings."""

import json
import tomllib

import numpy as np
import pandas as pd
import pytest
from refusal import refusal

from snarelab.cli import main
from snarelab.errors import InputError
from snarelab.identification.fitting.recorded import read_all, with_recorded_joints
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model
from snarelab.models.rigid_body import RigidBody
from snarelab.models.urdf import load_urdf

BOX = (
    '<inertial><origin xyz="0.2 0 0.05"/><mass value="{}"/>'
    '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial>'
)


def robot():
    """Two joints, and a gripper of two fingers of which one follows the other."""
    links = [("base", 5), ("upper", 4), ("fore", 2), ("left", 0.3), ("right", 0.3)]
    text = "".join(f'<link name="{name}">{BOX.format(mass)}</link>' for name, mass in links)
    for name, kind, parent, child, axis, extra in (
        ("shoulder", "revolute", "base", "upper", "0 1 0", ""),
        ("elbow", "revolute", "upper", "fore", "0 1 0", '<origin xyz="0.5 0 0"/>'),
        ("finger", "prismatic", "fore", "left", "1 0 0", '<origin xyz="0.4 0 0"/>'),
        ("finger2", "prismatic", "fore", "right", "-1 0 0", '<origin xyz="0.4 0 0"/><mimic joint="finger"/>'),
    ):
        text += f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        text += f'<axis xyz="{axis}"/>{extra}</joint>'
    return f'<robot name="gripping">{text}</robot>'


@pytest.fixture
def folder(tmp_path):
    """Model file and a recording of shoulder and elbow, the finger shut; torque with viscous friction of 3 and 2."""
    (tmp_path / "arm.urdf").write_text(robot())
    (tmp_path / "arm.toml").write_text('urdf = "arm.urdf"\neffects = ["viscous_friction"]\n')
    t = np.arange(3000) / 200
    w = 2 * np.pi * np.array([0.4, 0.6])
    q, qd, qdd = (a * f(w * t[:, None]) for a, f in ((1, np.sin), (w, np.cos), (-(w**2), np.sin)))
    still = np.zeros((len(t), 1))
    body = RigidBody(load_urdf(tmp_path / "arm.urdf"))
    tau = body.torque(*(np.hstack([x, still]) for x in (q, qd, qdd)))[:, :2] + [3, 2] * qd
    columns = {"time": t, "q.shoulder": q[:, 0], "q.elbow": q[:, 1], "tau.shoulder": tau[:, 0], "tau.elbow": tau[:, 1]}
    pd.DataFrame(columns).to_csv(tmp_path / "run.csv", index=False)
    return tmp_path


def identified(folder, model="arm.toml", recording="run.csv"):
    assert main(["identify", str(folder / model), str(folder / recording), "--json", str(folder / "out.json")]) == 0
    return json.loads((folder / "out.json").read_text())


def test_joints_that_nobody_recorded_are_held_and_said(folder):
    found = identified(folder)
    assert {p["at"]: round(p["value"], 3) for p in found["parameters"]} == {"shoulder": 3.0, "elbow": 2.0}
    assert "finger: in no recording, held where the URDF's zero is" in found["notes"]


@pytest.mark.parametrize("line", ['joints = ["shoulder", "elbow"]', "locked = { finger = 0.0 }"])
def test_the_model_file_says_which_joints_move(folder, line):
    (folder / "arm.toml").write_text(f'urdf = "arm.urdf"\neffects = ["viscous_friction"]\n{line}\n')
    found = identified(folder)
    assert {p["at"]: round(p["value"], 3) for p in found["parameters"]} == {"shoulder": 3.0, "elbow": 2.0}
    assert not any("in no recording" in note for note in found["notes"])
    save_model(load_model(folder / "arm.toml"), folder / "again.toml", "written")
    assert tomllib.loads(line).items() <= tomllib.loads((folder / "again.toml").read_text()).items()
    assert load_model(folder / "again.toml").joints == ("shoulder", "elbow")


def test_a_held_finger_changes_what_is_felt(folder):
    """Fingers that stand 0.5 m either side have twice their mass times its square more inertia than shut ones."""
    (folder / "open.toml").write_text('urdf = "arm.urdf"\neffects = ["viscous_friction"]\nlocked = { finger = 0.5 }\n')
    apart, shut = load_model(folder / "open.toml").tree, load_urdf(folder / "arm.urdf", held={"finger": 0.0})
    assert apart.links[1].phi[7] - shut.links[1].phi[7] == pytest.approx(2 * 0.3 * 0.5**2)
    assert identified(folder)["fit"]["tau.elbow"]["train"]["relative"] < 1e-6
    assert identified(folder, "open.toml")["fit"]["tau.elbow"]["train"]["relative"] > 0.01


def test_a_misspelt_column_is_no_joint_that_is_held(folder, capsys):
    table = pd.read_csv(folder / "run.csv").rename(columns={"q.elbow": "q.elbo", "tau.elbow": "tau.elbo"})
    table.to_csv(folder / "run.csv", index=False)
    assert main(["identify", str(folder / "arm.toml"), str(folder / "run.csv")]) == 2
    assert "no signal 'q.elbow' for a joint of the URDF" in capsys.readouterr().err


def test_effects_of_a_held_joint_go_with_it(folder):
    model = load_model(folder / "arm.toml")
    assert [p.at for p in model.effects] == ["shoulder", "elbow", "finger"]
    moving = with_recorded_joints(model, read_all(model, [folder / "run.csv"]))
    assert [p.at for p in moving.effects] == ["shoulder", "elbow"]
    assert moving.holding.locked == {"finger": 0.0}
    assert moving.tree.followers == ()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('joints = "elbow"', "allowed is a list of the names of the joints that move"),
        ("joints = []", "allowed is a list of the names"),
        ('joints = ["elbo"]', "joint 'elbo' is not one that moves (shoulder, elbow, finger); nearest is 'elbow'"),
        ("locked = [1]", "allowed is { joint = angle in rad, or m }"),
        ("locked = { elbow = true }", "allowed is { joint = angle in rad, or m }"),
        ("locked = { elbo = 0.0 }", "joint 'elbo' is not one that moves"),
        ("locked = { shoulder = 0, elbow = 0, finger = 0 }", "all 3 joints are held; let at least one move"),
        ('joints = ["elbow"]\nlocked = { elbow = 0 }', "joint 'elbow' is among joints, which move, and among locked"),
        ('inertia_fix = "any"', "inertia_fix = 'any'; allowed is 'nearest'"),
    ],
)
def test_mistakes_are_one_line(folder, line, words):
    (folder / "arm.toml").write_text(f'urdf = "arm.urdf"\n{line}\n')
    refusal(lambda: load_model(folder / "arm.toml"), folder, words)


def test_the_built_in_systems_have_nothing_to_hold(tmp_path):
    (tmp_path / "rig.toml").write_text('system = "zero_g_rig"\nlocked = { joint1 = 0.0 }\n')
    with pytest.raises(InputError, match="key 'locked' belongs to an arm with a URDF of its own"):
        load_model(tmp_path / "rig.toml")
