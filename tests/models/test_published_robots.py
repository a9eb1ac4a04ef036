"""Robots as they are published: every URDF of a package of examples, beside Pinocchio's torque."""

# pyright: reportAttributeAccessIssue=false
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from snarelab.errors import InputError
from snarelab.models.rigid_body import symbolic_torque
from snarelab.models.urdf import load_urdf

REFUSED = {
    "iris_simple.urdf": "no joint moves",
    "quadrotor_base.urdf": "no joint moves",
    "romeo_laas_small.urdf": "link 'LShoulderYaw_link' has an inertia that no body can have",
    "romeo_small.urdf": "link 'RShoulderYawLink' has an inertia that no body can have",
    "ur3.urdf": "root links are []",
}
"""What the others really lack."""


def robots():
    """The package's URDFs; it has no module, only files."""
    try:
        place = distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")
    except PackageNotFoundError:
        return []
    return sorted(Path(str(place)).glob("**/*.urdf"))


ROBOTS = robots()
pytestmark = pytest.mark.skipif(not ROBOTS, reason="example-robot-data is not installed: make .venv/installed does it")
GOOD = [path for path in ROBOTS if path.name not in REFUSED]


def test_nearly_all_load():
    assert len(ROBOTS) >= 69
    assert len(GOOD) >= 64


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused_lacks_something(name):
    (path,) = [path for path in ROBOTS if path.name == name]
    with pytest.raises(InputError, match="urdf: ") as caught:
        load_urdf(path)
    assert REFUSED[name] in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["romeo_laas_small.urdf", "romeo_small.urdf"])
def test_an_inertia_that_matters_is_mended_on_demand(name):
    (path,) = [path for path in ROBOTS if path.name == name]
    tree = load_urdf(path, fix="nearest")
    assert any(note.startswith("inertia_fix: ") for note in tree.notes)


def pinocchio_torque(path, joints, q, qd, qdd):
    """Torque of the freedoms that we have, all others of the file held at zero or led; by virtual work."""
    model = pin.buildModelFromUrdf(str(path))
    model.gravity.linear = np.array([0.3, -0.2, -9.81])
    place, data = np.array(pin.neutral(model)), model.createData()
    rates, second = np.zeros(model.nv), np.zeros(model.nv)
    for joint, leader, times, offset in joints:
        own = model.joints[model.getJointId(joint)]
        angle = times * q[leader] + offset
        place[own.idx_q : own.idx_q + own.nq] = angle if own.nq == 1 else [np.cos(angle), np.sin(angle)]
        rates[own.idx_v], second[own.idx_v] = times * qd[leader], times * qdd[leader]
    full, felt = pin.rnea(model, data, place, rates, second), np.zeros(len(q))
    for joint, leader, times, _ in joints:
        felt[leader] += times * full[model.joints[model.getJointId(joint)].idx_v]
    return felt


@pytest.mark.parametrize("path", GOOD, ids=lambda path: f"{path.parent.parent.name}-{path.stem}")
def test_torque_is_pinocchios(path):
    whole = load_urdf(path, (0.3, -0.2, -9.81))
    rng = np.random.default_rng(0)
    trees = [whole]
    if whole.n_joints > 1:  # and with every other joint held at zero
        trees.append(load_urdf(path, whole.gravity, moving=[joint.name for joint in whole.joints[::2]]))
    for tree in trees:
        n = tree.n_joints
        q, qd, qdd = rng.normal(size=(3, n))
        torque = symbolic_torque(tree, *(ca.SX(ca.DM(x)) for x in (q, qd, qdd, tree.gravity, tree.phi)))
        ours = np.array(ca.DM(torque).elements())
        bodies = [(joint.name, *rest) for joint, *rest in tree.bodies]
        theirs = pinocchio_torque(path, bodies, q, qd, qdd)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-10 * max(1.0, np.abs(theirs).max()))
