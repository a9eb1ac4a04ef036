"""Effects along combinations of joints, and recordings of motors: fit, derivatives, forward and inverse dynamics."""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from driven_arm import LEVEL, VISCOUS, model_file, recorded, speed
from moving_arm import build, jacobian, motion, placed, three_joints

import snarelab
from bench.fmu_models import accelerations, everywhere, made_slave, write_model
from snarelab.errors import InputError
from snarelab.fmu.export import model_equations
from snarelab.fmu.inverse import inverse_equations
from snarelab.identification.fitting.base_parameters import base_parameters
from snarelab.identification.fitting.experiment import Experiment
from snarelab.models.axes import JointAxis, place
from snarelab.models.effects import get_effect
from snarelab.models.model import places
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model

ENGINE: Any = pin  # its stubs lack most names
TIE, TIE_VISCOUS, TIE_INERTIA = 5.0, 4.0, 0.3
MATRIX = np.array([[1.0, 0.0], [-1.0, 1.0]])
"""Motor 3 turns with joints 2 and 3: q3 = motor3 - motor2."""
JOINT_LAWS = '"viscous_friction", "coulomb_friction"'
AT_MOTOR = [
    f'{{ name = "{name}", at = "motor3" }}' for name in ("viscous_friction", "coulomb_friction", "rotor_inertia")
]
TRANSMISSION = (
    '[transmission]\nmotors = ["motor2", "motor3"]\njoints = ["joint2", "joint3"]\nmatrix = [[1.0, 0.0], [-1.0, 1.0]]\n'
)


def write(folder, tail, effects, name):
    path = folder / name
    path.write_text(f'urdf = "arm.urdf"\neffects = [{effects}]\n{tail}', encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def wrist(tmp_path_factory):
    """MuJoCo's arm, a coupled motor's friction and inertia on its torques: recordings of joints, and of motors."""
    folder = tmp_path_factory.mktemp("wrist")
    _, tables = recorded(folder)
    for name, table in zip(("train", "holdout"), tables, strict=True):
        w = speed(table, "joint2") + speed(table, "joint3")
        force = TIE * np.tanh(w / 1e-3) + TIE_VISCOUS * w + TIE_INERTIA * np.gradient(w, table["time"])
        for joint in ("joint2", "joint3"):
            table[f"tau.{joint}"] += force
        table.to_csv(folder / f"{name}.csv", index=False)
        motors = table.drop(columns=[f"{x}.joint{k}" for x in ("q", "tau") for k in (2, 3)])
        q, tau = (table[[f"{x}.joint2", f"{x}.joint3"]].to_numpy() for x in ("q", "tau"))
        q_motor, tau_motor = q @ np.linalg.inv(MATRIX).T, tau @ MATRIX
        for k in (0, 1):
            motors[f"q.motor{k + 2} [deg]"] = np.degrees(q_motor[:, k])
            motors[f"tau.motor{k + 2}"] = tau_motor[:, k]
        motors.to_csv(folder / f"motors_{name}.csv", index=False)
    return folder


def by_place(result):
    return {(p.effect, p.at): p for p in result.parameters}


@pytest.fixture(scope="module")
def tied(wrist):
    model = write(wrist, TRANSMISSION, ", ".join([JOINT_LAWS, *AT_MOTOR]), "tied.toml")
    return model, snarelab.identify(model, wrist / "motors_train.csv", holdout=wrist / "motors_holdout.csv")


def test_a_coupled_motors_friction_and_inertia_are_found_beside_the_joints_own(tied):
    _, result = tied
    found = by_place(result)
    for name, true in (("coulomb_friction", TIE), ("viscous_friction", TIE_VISCOUS), ("rotor_inertia", TIE_INERTIA)):
        p = found[name, "motor3"]
        assert p.value == pytest.approx(true, rel=0.05)
        assert abs(p.value - true) < 3 * p.std
    assert found["coulomb_friction", "joint3"].value == pytest.approx(LEVEL, rel=0.1)
    assert found["viscous_friction", "joint2"].value == pytest.approx(VISCOUS, rel=0.15)
    assert ("coulomb_friction", "motor2") not in found  # everywhere means every joint


def test_joints_alone_cannot_say_what_a_coupled_motor_does(tied, wrist):
    _, result = tied
    alone = snarelab.identify(
        write(wrist, "", JOINT_LAWS, "alone.toml"), wrist / "train.csv", holdout=wrist / "holdout.csv"
    )
    for c in ("tau.joint2", "tau.joint3"):
        assert result.fit[c]["holdout"]["relative"] < 0.7 * alone.fit[c]["holdout"]["relative"]


def test_motors_say_what_joints_do(tied, wrist):
    """The same physics from the joints' columns, at an axis of a model without motors."""
    _, result = tied
    effects = ", ".join([JOINT_LAWS, *(x.replace("motor3", "tie") for x in AT_MOTOR)])
    model = write(wrist, '[axes]\n"tie" = { joint2 = 1.0, joint3 = 1.0 }\n', effects, "axis.toml")
    other = snarelab.identify(model, wrist / "train.csv")
    own, others = by_place(result), by_place(other)
    for (effect, at), p in own.items():
        assert others[effect, at.replace("motor3", "tie")].value == pytest.approx(p.value, rel=1e-6)


def test_a_saved_model_has_its_motors_and_simulates_with_them(tied, wrist):
    path, result = tied
    result.save_model(wrist / "saved.toml")
    saved = load_model(wrist / "saved.toml")
    assert saved.transmission is not None
    np.testing.assert_array_equal(saved.transmission.matrix, MATRIX)
    assert {p.key for p in saved.effects} == {p.key for p in load_model(path).effects}
    run = snarelab.simulate(saved, wrist / "motors_holdout.csv")
    again = snarelab.simulate(saved, wrist / "holdout.csv")
    np.testing.assert_allclose(run["tau.joint3"], again["tau.joint3"], atol=1e-6)


@pytest.mark.slow
def test_a_search_finds_the_coupled_motor(wrist):
    model = write(wrist, TRANSMISSION, JOINT_LAWS, "search.toml")
    answer = snarelab.diagnose(model, wrist / "motors_train.csv", holdout=wrist / "motors_holdout.csv")
    assert "motor3" in {e.at for e in answer.effects}
    assert answer.steps[-1].holdout < 0.7 * answer.steps[0].holdout


AXES = (
    JointAxis("tie", {"joint1": 1.0, "joint2": -0.5}, {"joint1": 0.8, "joint2": -0.4}, "revolute"),
    JointAxis("motor", {"joint1": 2.0}, {"joint1": 0.5}, "revolute"),
)
LAWS = [
    ("load_dependent_friction", "tie"),
    ("stribeck_friction", "tie"),
    ("presliding_hysteresis", "tie"),
    ("rotor_inertia", "motor"),
    ("sensor_gain", "tau.joint1"),
]


@pytest.mark.parametrize("free", [False, True])
def test_derivatives_at_axes(tmp_path, free):
    tree, _ = three_joints(tmp_path)
    tree = replace(tree, axes=AXES)
    body = snarelab.models.rigid_body.RigidBody(tree)
    experiment = Experiment(motion([j.kind for j in tree.joints]), body)
    base = base_parameters(body) if free else None
    assembly = build((tree, body), experiment, placed(*LAWS), base)
    theta = np.clip(assembly.start + 0.1 + 0.05 * np.abs(assembly.start), assembly.low, assembly.high)
    theta[[s.name == "by_load" for s in assembly.slots]] = 0.0  # bristles follow the load only as they would in motion
    if base is not None:
        theta[: len(base.columns)] = base.matrix @ tree.phi
    found = jacobian(assembly, experiment, theta)
    for i in range(len(theta)):
        step = np.zeros(len(theta))
        step[i] = 1e-5 * max(abs(theta[i]), 1e-2)
        ends = [assembly.torque(experiment, theta + s * step) for s in (1, -1)]
        numeric = (ends[0] - ends[1]) / (2 * step[i])
        missed = np.linalg.norm(found[:, :, i] - numeric)
        assert missed < 1e-6 * np.linalg.norm(numeric) + 1e-9, assembly.slots[i].key


def test_virtual_work_at_an_axis(tmp_path):
    """Power of what the joints feel is the law's power along the axis, whatever the law."""
    tree, body = three_joints(tmp_path)
    tree = replace(tree, axes=AXES)
    experiment = Experiment(motion([j.kind for j in tree.joints]), body)
    assembly = build((tree, body), experiment, placed(("viscous_friction", "tie")))
    change = assembly.torque(experiment, np.array([3.0])) - assembly.torque(experiment, np.zeros(1))
    w = experiment.motion.qd @ np.array([1.0, -0.5, 0.0])
    np.testing.assert_allclose(np.sum(change * experiment.motion.qd, axis=1), 3.0 * w**2, atol=1e-9)
    here = place(tree, "tie")
    assert here.along @ here.back == pytest.approx(1.0)


@pytest.mark.parametrize(("at", "sign"), [("joint1+joint2", 1.0), ("joint1-joint2", -1.0)])
def test_a_spring_between_two_joints_follows_from_its_energy(tmp_path, at, sign):
    tree, body = three_joints(tmp_path)
    experiment = Experiment(motion([j.kind for j in tree.joints]), body)
    assembly = build((tree, body), experiment, placed(("joint_spring", at)))
    change = assembly.torque(experiment, np.array([7.0, -2.0])) - assembly.torque(experiment, np.zeros(2))

    def energy(q):
        return 3.5 * (q[:, 0] + sign * q[:, 1]) ** 2 - 2.0 * (q[:, 0] + sign * q[:, 1])

    q = experiment.motion.q
    slopes = [(energy(q + 1e-5 * d) - energy(q - 1e-5 * d)) / 2e-5 for d in np.eye(3)]
    np.testing.assert_allclose(change, np.stack(slopes, axis=1), atol=1e-7)


def test_neighbours_are_places_for_a_spring_unasked(tmp_path):
    tree, _ = three_joints(tmp_path)
    # The third joint slides: an angle and a length are not added.
    assert places(get_effect("joint_spring"), tree) == ("joint1+joint2", "joint1-joint2")
    recorded(tmp_path, "a", 1.0)
    path = write(tmp_path, "", '{ name = "coulomb_friction", at = "joint2-joint3" }', "pair.toml")
    assert [p.key for p in load_model(path).effects] == ["coulomb_friction.joint2-joint3"]
    with pytest.raises(InputError, match=r"joint1\+joint2"):
        load_model(write(tmp_path, "", '{ name = "joint_spring", at = "joint1" }', "wrong.toml"))


@pytest.mark.parametrize("laws", [("rotor_inertia",), ("rotor_inertia", "load_dependent_friction", "viscous_friction")])
def test_an_arm_moves_as_another_engine_says_with_effects_at_an_axis(tmp_path, laws):
    values = {"rotor_inertia.tie.inertia": 0.6, "load_dependent_friction.tie.coefficient": 0.25}
    values |= {"viscous_friction.tie.coefficient": 3.0, "speed_scale.tie": 1.0}
    values |= everywhere("rotor_inertia", "inertia", [0.5, 0.2, 0.4])
    effects = ", ".join(['"rotor_inertia"', *(f'{{ name = "{x}", at = "tie" }}' for x in laws)])
    path = write_model(tmp_path, "arm", 3, f"[{effects}]", values, seed=8)
    path.write_text(path.read_text() + "[axes]\ntie = { joint2 = 1.0, joint3 = 2.0 }\n")
    model = ENGINE.buildModelFromXML(path.with_suffix(".urdf").read_text())
    data = model.createData()
    along, rng = np.array([0.0, 1.0, 2.0]), np.random.default_rng(1)
    equations = model_equations(load_model(path))
    for _ in range(4):
        q, qd, tau = rng.normal(size=(3, 3))
        tau *= 20.0
        qdd = accelerations(tmp_path, equations, q, qd, tau)
        load = ENGINE.rnea(model, data, q, qd, qdd)
        w, carried = along @ qd, load @ along / 5.0
        force = 0.6 * along @ qdd
        if len(laws) > 1:
            force += 3.0 * w + 0.25 * abs(carried) * np.tanh(w / 3e-4)
        taken = np.array([0.5, 0.2, 0.4]) * qdd + along * force
        np.testing.assert_allclose(load + taken, tau, rtol=0, atol=1e-8 * np.abs(tau).max())


def test_an_inverse_fmu_reads_what_simulate_says(tmp_path):
    values = {
        "coulomb_friction.tie.level": 4.0,
        "load_dependent_friction.tie.coefficient": 0.25,
        "speed_scale.tie": 1.0,
    }
    effects = '[{ name = "coulomb_friction", at = "tie" }, { name = "load_dependent_friction", at = "tie" }]'
    path = write_model(tmp_path, "arm", 3, effects, values, seed=8)
    path.write_text(path.read_text() + "[axes]\ntie = { joint2 = 1.0, joint3 = 2.0 }\n")
    model = ENGINE.buildModelFromXML(path.with_suffix(".urdf").read_text())
    data, rng = model.createData(), np.random.default_rng(1)
    q, qd, qdd = rng.normal(size=(3, 3))
    given = {f"{n}.joint{k + 1}": x[k] for n, x in (("q", q), ("qd", qd), ("qdd", qdd)) for k in range(3)}
    s = made_slave(tmp_path, inverse_equations(load_model(path)), **given)
    found = s.get([f"tau.joint{k}" for k in (1, 2, 3)])
    s.close()
    load, along = ENGINE.rnea(model, data, q, qd, qdd), np.array([0.0, 1.0, 2.0])
    force = (4.0 + 0.25 * abs(load @ along / 5.0)) * np.tanh(along @ qd / 3e-4)
    np.testing.assert_allclose(found, load + along * force, atol=1e-9)


def test_a_model_with_an_axis_is_written_and_read_back(tmp_path):
    recorded(tmp_path, "", 1.0)
    tail = '[axes]\n"tie" = { joint2 = 1.0, joint3 = 2.0 }\n'
    model = load_model(write(tmp_path, tail, '{ name = "coulomb_friction", at = "tie" }', "m.toml"))
    save_model(model, tmp_path / "again.toml", "note")
    again = load_model(tmp_path / "again.toml")
    assert dict(again.tree.axes[0].along) == {"joint2": 1.0, "joint3": 2.0}
    assert [p.key for p in again.effects] == ["coulomb_friction.tie"]


WRONG = [
    ("[axes]\njoint1 = { joint2 = 1.0 }", "is a joint's name"),
    ("[axes]\ntie = { joint9 = 1.0 }", "did you mean"),
    ("[axes]\ntie = { joint1 = 0.0 }", "not all zero"),
    ("[axes]\ntie = { joint1 = 'x' }", "allowed is { joint = factor"),
    ("axes = 3", "[axes] must be a table"),
    ("[transmission]\nmotors = ['m']", "has motors = [names]"),
    ("[transmission]\nmotors = ['m', 'm']\njoints = ['joint1', 'joint2']\nmatrix = [[1, 0], [0, 1]]", "each once"),
    (
        "[transmission]\nmotors = ['m', 'n']\njoints = ['joint1', 'joint9']\nmatrix = [[1, 0], [0, 1]]",
        "'joint9' is no joint",
    ),
    (
        "[transmission]\nmotors = ['m', 'joint3']\njoints = ['joint1', 'joint2']\nmatrix = [[1, 0], [0, 1]]",
        "joint's name",
    ),
    ("[transmission]\nmotors = ['m', 'n']\njoints = ['joint1', 'joint2']\nmatrix = [[1, 0]]", "2 rows, a joint each"),
    ("[transmission]\nmotors = ['m', 'n']\njoints = ['joint1', 'joint2']\nmatrix = [[1, 1], [1, 1]]", "singular"),
    (f"{TRANSMISSION}[axes]\nmotor2 = {{ joint1 = 1.0 }}", "is an axis and a motor"),
    (f'{TRANSMISSION}[signals]\n"tau.motor2" = {{ column = "i", gain = "free" }}', "mix the motors' columns"),
    (f'{TRANSMISSION}[signals]\n"qd.motor2" = "v"', "of a motor q and tau are read"),
]


@pytest.mark.parametrize(("lines", "said"), WRONG)
def test_wrong_axes_and_motors_are_refused_in_one_line(tmp_path, lines, said):
    recorded(tmp_path, "", 1.0)
    with pytest.raises(InputError) as error:
        load_model(model_file(tmp_path, lines))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_motor_that_was_not_recorded_is_named(wrist):
    (wrist / "half.csv").write_text((wrist / "motors_train.csv").read_text().replace("tau.motor3", "other"))
    with pytest.raises(InputError, match=r"has tau\.motor2 and no tau\.motor3"):
        snarelab.identify(write(wrist, TRANSMISSION, JOINT_LAWS, "half.toml"), wrist / "half.csv")


def test_a_spring_beside_an_axis_has_no_forward_dynamics(tmp_path):
    values = {"joint_elasticity.joint2.stiffness": 1e4, "joint_elasticity.joint2.damping": 1.0}
    values |= {"viscous_friction.tie.coefficient": 3.0, "rotor_inertia.joint2.inertia": 0.5}
    effects = (
        '[{ name = "joint_elasticity", at = "joint2" }, { name = "viscous_friction", at = "tie" }, '
        '{ name = "rotor_inertia", at = "joint2" }]'
    )
    path = write_model(tmp_path, "arm", 3, effects, values, seed=8)
    path.write_text(path.read_text() + "[axes]\ntie = { joint2 = 1.0, joint3 = 2.0 }\n")
    with pytest.raises(InputError, match="export with --inverse"):
        model_equations(load_model(path))
