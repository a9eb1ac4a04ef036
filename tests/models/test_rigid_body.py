"""Rigid-body torque against Drake on random trees, closed forms and conservation of energy."""

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces, MultibodyForces_

from snarelab.errors import InputError
from snarelab.models import compiled
from snarelab.models.compiled import CompilerNotice
from snarelab.models.inertia import from_central
from snarelab.models.rigid_body import RigidBody
from snarelab.models.tree import Joint, Link, Tree
from snarelab.models.urdf import load_urdf

GRAVITY = (1.2, -0.7, -9.3)
pytestmark = pytest.mark.usefixtures("own_cache")


def words(values) -> str:
    return " ".join(repr(float(value)) for value in values)


def random_inertial(rng) -> str:
    """A body of random points, so physical whatever the numbers."""
    points = rng.normal(size=(6, 3)) * 0.3
    matrix = np.sum([p @ p * np.eye(3) - np.outer(p, p) for p in points], axis=0)
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    tensor = " ".join(f'{key}="{value}"' for key, value in zip(keys, matrix[np.triu_indices(3)], strict=True))
    return (
        f'<inertial><origin xyz="{words(rng.normal(size=3))}" rpy="{words(rng.uniform(-3, 3, 3))}"/>'
        f'<mass value="{rng.uniform(0.5, 5)}"/><inertia {tensor}/></inertial>'
    )


def joint_text(rng, name, kind, parent, child) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{words(rng.normal(size=3))}" rpy="{words(rng.uniform(-3, 3, 3))}"/>'
        f'<axis xyz="{words(rng.normal(size=3))}"/></joint>'
    )


def random_urdf(n_joints: int, seed: int) -> str:
    """A branching tree; a third of the links carry a welded link with mass, which may carry the next joint."""
    rng = np.random.default_rng(seed)
    text, carriers = f'<link name="base">{random_inertial(rng)}</link>', ["base"]
    for i in range(n_joints):
        parent = carriers[rng.integers(max(0, len(carriers) - 3), len(carriers))]
        kind = rng.choice(["revolute", "continuous", "prismatic"], p=[0.4, 0.2, 0.4])
        text += f'<link name="link{i}">{random_inertial(rng)}</link>' + joint_text(
            rng, f"j{i}", kind, parent, f"link{i}"
        )
        carriers.append(f"link{i}")
        if rng.random() < 0.35:
            text += f'<link name="weld{i}">{random_inertial(rng)}</link>'
            text += joint_text(rng, f"w{i}", "fixed", f"link{i}", f"weld{i}")
            carriers.append(f"weld{i}")
    return f'<robot name="random">{text}</robot>'


class DrakeArm:
    """Drake's answers, joints in the order of the names given."""

    def __init__(self, text: str, names: list[str]) -> None:
        self.plant: Any = MultibodyPlant(0.0)
        Parser(self.plant).AddModelsFromString(text, "urdf")
        self.plant.WeldFrames(self.plant.world_frame(), self.plant.GetBodyByName("base").body_frame())
        self.plant.mutable_gravity_field().set_gravity_vector(GRAVITY)
        self.plant.Finalize()
        self.order = [self.plant.GetJointByName(name).velocity_start() for name in names]

    def _sorted(self, values):
        placed = np.empty(values.shape, values.dtype)
        placed[self.order] = values
        return placed

    def torque(self, q, qd, qdd):
        context, forces, tau = self.plant.CreateDefaultContext(), MultibodyForces(self.plant), np.empty(q.shape)
        for k in range(len(q)):
            self.plant.SetPositions(context, self._sorted(q[k]))
            self.plant.SetVelocities(context, self._sorted(qd[k]))
            self.plant.CalcForceElementsContribution(context, forces)
            tau[k] = self.plant.CalcInverseDynamics(context, self._sorted(qdd[k]), forces)[self.order]
        return tau

    def mass_matrix(self, q):
        context, matrices = self.plant.CreateDefaultContext(), []
        for row in q:
            self.plant.SetPositions(context, self._sorted(row))
            matrices.append(self.plant.CalcMassMatrix(context)[np.ix_(self.order, self.order)])
        return np.array(matrices)

    def tangent(self, q, qd, qdd):
        """Derivatives with respect to (q, qd) at one sample, by Drake's own automatic differentiation."""
        plant: Any = self.plant.ToAutoDiffXd()
        seed, number = cast(Any, InitializeAutoDiff), cast(Any, AutoDiffXd)  # their type stubs want scalars
        context, forces = plant.CreateDefaultContext(), MultibodyForces_[AutoDiffXd](plant)
        state = seed(np.concatenate([q, qd]))[:, 0]
        plant.SetPositions(context, self._sorted(state[: len(q)]))
        plant.SetVelocities(context, self._sorted(state[len(q) :]))
        plant.CalcForceElementsContribution(context, forces)
        acceleration = np.array([number(value, np.zeros(2 * len(q))) for value in qdd])
        gradient = ExtractGradient(plant.CalcInverseDynamics(context, self._sorted(acceleration), forces))
        return gradient[self.order, : len(q)], gradient[self.order, len(q) :]


def both(folder: Path, n_joints: int, seed: int):
    text = random_urdf(n_joints, seed)
    path = folder / "random.urdf"
    path.write_text(text)
    tree = load_urdf(path, GRAVITY)
    return RigidBody(tree), DrakeArm(text, [joint.name for joint in tree.joints])


def motion(n_samples: int, n_joints: int, seed: int = 0):
    return np.random.default_rng(seed).normal(size=(3, n_samples, n_joints)) * [[[2.0]], [[1.5]], [[3.0]]]


def relative(ours, theirs):
    assert ours.shape == theirs.shape
    return np.abs(ours - theirs).max() / np.abs(theirs).max()


@pytest.mark.parametrize("n_joints", range(1, 10))
def test_torque_and_mass_matrix_agree_with_drake(tmp_path, n_joints):
    for seed in (n_joints, 100 + n_joints):
        body, drake = both(tmp_path, n_joints, seed)
        q, qd, qdd = motion(30, n_joints, seed)
        assert relative(body.torque(q, qd, qdd), drake.torque(q, qd, qdd)) < 1e-10
        assert relative(body.mass_matrix(q), drake.mass_matrix(q)) < 1e-10


@pytest.mark.parametrize("n_joints", [1, 3, 6])
def test_tangent_agrees_with_drakes_automatic_differentiation(tmp_path, n_joints):
    body, drake = both(tmp_path, n_joints, seed=20 + n_joints)
    q, qd, qdd = motion(5, n_joints)
    by_q, by_qd = body.tangent(q, qd, qdd)
    for k in range(5):
        drake_by_q, drake_by_qd = drake.tangent(q[k], qd[k], qdd[k])
        assert relative(by_q[k], drake_by_q) < 1e-10
        assert np.abs(by_qd[k] - drake_by_qd).max() <= 1e-10 * np.abs(drake_by_q).max()


def test_regressor_columns_are_the_torque_of_point_masses_in_drake(tmp_path):
    """Point masses at ten or more places span all ten parameters of a link."""
    n_joints, rng = 5, np.random.default_rng(3)
    body, drake = both(tmp_path, n_joints, seed=48)
    kinds = [joint.kind for joint in body.tree.joints]
    # Only where a joint hangs from a revolute one does a twist that is carried outward gain the slide of an arm.
    assert ("revolute", "revolute") in {(kinds[j.parent], j.kind) for j in body.tree.joints if j.parent >= 0}
    q, qd, qdd = motion(4, n_joints)
    regressor = body.regressor(q, qd, qdd)
    bare, text = drake.torque(q, qd, qdd), (tmp_path / "random.urdf").read_text()
    names = [joint.name for joint in body.tree.joints]
    for i, link in enumerate(body.tree.links):
        places = rng.normal(size=(12, 3))
        columns = [from_central(2.0, place, np.zeros((3, 3))) for place in places]
        assert np.linalg.matrix_rank(columns) == 10
        for place, column in zip(places, columns, strict=True):
            weight = (
                f'<link name="weight"><inertial><origin xyz="{words(place)}"/><mass value="2"/>'
                '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>'
                f'<joint name="on" type="fixed"><parent link="{link.name}"/><child link="weight"/></joint></robot>'
            )
            loaded = DrakeArm(text.replace("</robot>", weight), names).torque(q, qd, qdd)
            predicted = regressor[:, :, 10 * i : 10 * i + 10] @ column
            assert np.abs(predicted - (loaded - bare)).max() < 1e-10 * np.abs(loaded).max()
    assert relative(regressor @ body.tree.phi, bare) < 1e-10


def test_other_parameters_and_gravity(tmp_path):
    body, _ = both(tmp_path, 4, seed=48)
    q, qd, qdd = motion(10, 4)
    phi = np.random.default_rng(1).normal(size=40)
    moon = np.array([0.0, 0.0, -1.62])
    expected = RigidBody(replace(body.tree, gravity=moon)).regressor(q, qd, qdd) @ phi
    assert relative(body.torque(q, qd, qdd, phi=phi, gravity=moon), expected) < 1e-12
    assert relative(body.regressor(q, qd, qdd, gravity=moon) @ phi, expected) < 1e-12
    step = 1e-3 * np.random.default_rng(2).normal(size=qdd.shape)
    change = body.torque(q, qd, qdd + step, phi=phi) - body.torque(q, qd, qdd, phi=phi)
    assert relative(np.einsum("nij,nj->ni", body.mass_matrix(q, phi), step), change) < 1e-9


def test_no_work_over_a_closed_motion(tmp_path):
    """A conservative system gives back over a period what it took (the trapezoid rule is exact for smooth periods)."""
    body, _ = both(tmp_path, 6, seed=51)
    rng, phase = np.random.default_rng(5), np.linspace(0, 2 * np.pi, 400, endpoint=False)[:, None]
    first, second = rng.uniform(-0.5, 0.5, (2, 6))
    q = first * np.sin(phase) + second * np.cos(2 * phase)
    qd = first * np.cos(phase) - 2 * second * np.sin(2 * phase)
    qdd = -first * np.sin(phase) - 4 * second * np.cos(2 * phase)
    power = np.sum(qd * body.torque(q, qd, qdd), axis=1)
    assert abs(power.mean()) < 1e-11 * np.abs(power).mean()


def one_joint(kind, axis, phi):
    joint = Joint("a", kind, np.array(axis), -1, np.eye(3), np.zeros(3))
    return Tree("one", (joint,), (Link("b", np.asarray(phi)),), np.array([0.0, 0.0, -9.81]))


def test_pendulum_and_lift():
    q, qd, qdd = motion(50, 1)
    pendulum = one_joint("revolute", (0.0, 1.0, 0.0), from_central(2.0, [0, 0, -0.7], np.diag([0.1, 0.2, 0.15])))
    expected = (0.2 + 2.0 * 0.7**2) * qdd + 2.0 * 9.81 * 0.7 * np.sin(q)
    np.testing.assert_allclose(RigidBody(pendulum).torque(q, qd, qdd), expected, rtol=1e-12, atol=1e-12)
    lift = one_joint("prismatic", (0.0, 0.0, 1.0), from_central(3.0, [0.1, 0.2, 0.3], np.eye(3)))
    np.testing.assert_allclose(RigidBody(lift).torque(q, qd, qdd), 3.0 * (qdd + 9.81), rtol=1e-12)


def test_the_virtual_machine_agrees_with_c(tmp_path, monkeypatch):
    body, _ = both(tmp_path, 5, seed=61)
    q, qd, qdd = motion(200, 5)

    def answers(of):
        return [of.torque(q, qd, qdd), of.regressor(q, qd, qdd), of.mass_matrix(q), *of.tangent(q, qd, qdd)]

    in_c = answers(body)
    monkeypatch.setenv("SNARELAB_CC", "none")
    compiled._notify.cache_clear()
    slow = RigidBody(body.tree)
    with pytest.warns(CompilerNotice, match="SNARELAB_CC is 'none'") as caught:
        in_machine = answers(slow)
    assert len(caught) == 1
    for fast, steady in zip(in_c, in_machine, strict=True):
        assert fast.shape == steady.shape
        assert relative(fast, steady) < 1e-12


def test_rigid_body_checks_its_inputs():
    body = RigidBody(one_joint("revolute", (0.0, 1.0, 0.0), from_central(1.0, np.zeros(3), np.eye(3))))
    good, bad = np.zeros((3, 1)), np.array([[0.0], [np.nan], [0.0]])
    for said, call in {
        r"q has shape \(3, 2\)": lambda: body.torque(np.zeros((3, 2)), good, good),
        r"qd has shape \(4, 1\)": lambda: body.torque(good, np.zeros((4, 1)), good),
        r"q has shape \(\)": lambda: body.mass_matrix(1.0),
        "qdd of joint 'a' is nan in row 1": lambda: body.regressor(good, good, bad),
        "phi has shape": lambda: body.torque(good, good, good, phi=np.zeros(9)),
        "gravity has shape": lambda: body.tangent(good, good, good, gravity=[0, 0, np.inf]),
    }.items():
        with pytest.raises(InputError, match=said):
            call()
