"""``snarelab simulate`` of a floating base: where an arm that follows a recorded motion takes it.

Joints follow the recording; base and joint torques are the model's. The base starts as recorded, or where its pose and
twist are not recorded, in the world's frame and without any momentum.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..models.dormand_prince import StepFault
from ..models.floating.carried_base import BaseTrajectory, CarriedBase, JointPath
from ..models.floating.tree import CARRIERS, FloatingTree, arm_on
from ..models.hidden_state import evaluate_law
from ..models.model import Model
from ..models.rig.points import far_end
from ..models.rigid_body import RigidBody
from ..recordings.condition import Motion, condition
from ..recordings.signals import QUATERNION
from .fitting.assembly import TorqueModel
from .fitting.experiment import Experiment, scales, without_torque
from .fitting.floating_terms import outside, told, wheel_impulse, with_base, with_twist
from .fitting.recorded import read_motion

Array = NDArray[np.float64]


def simulate_floating(model: Model, motion: str | Path) -> xr.Dataset:
    """Motion of the base and torque of the joints along a recorded motion of the joints.

    Parameters
    ----------
    model : Model
        Of a floating base, with values of all parameters.
    motion : path
        Recording with the position of every joint; torque is not used.

    Returns
    -------
    xarray.Dataset
        ``q qd qdd tau`` of every joint, ``pos quat vel omega`` of the base in the world, what was recorded of wrenches
        on it, over the samples whose derivatives are known.

    Raises
    ------
    InputError
        An effect that displaces links, a recording with a gap, or no finite motion.
    """
    tree = model.tree_as(FloatingTree)
    for p in model.effects:
        if p.effect.acts_on == "position":
            raise InputError(
                f"{model.path}: {p.effect.name} at {p.at} moves the arm behind its encoder, which a floating base "
                "feels; take it out to simulate"
            )
    dataset = with_base(without_torque(read_motion(model, motion), model), tree)
    recorded = f"vel.{tree.body}.x" in dataset
    known = with_twist(dataset, tree) if recorded else _at_rest(dataset, tree)
    followed = condition(known, model.joints, model.bandwidth, fitted=False)
    if len(followed.segments) > 1:
        raise InputError(
            f"{motion}: the motion has {len(followed.segments) - 1} gaps, across which nobody knows where the base "
            "floats; cut the recording there"
        )
    path = _path(dataset, followed, tree)
    first = TorqueModel(model.tree, model.effects, None, scales([_experiment(followed, tree)]), model.values)
    theta = np.array([model.values[s.key] for s in first.slots])
    laws = [(p.effect, first.parameters(k, theta)) for k, p in enumerate(first.placed) if p.effect.at == "base"]
    base = CarriedBase(arm_on(tree, _inertia(first, theta)), laws)
    row = int(np.argmin(np.abs(dataset["time"].values - followed.time[0])))
    try:
        found = base.follow(path, *_pose(dataset, tree, row, recorded), followed.q[0, :CARRIERS] if recorded else None)
    except StepFault as fault:
        raise InputError(f"{model.path}: the base's motion along {motion} cannot be followed: {fault}") from None
    along = replace(_experiment(_with_base(followed, found), tree), impulse=path.impulse)
    return _table(model, tree, path, found, first.torque(along, theta), followed)


def _at_rest(dataset: xr.Dataset, tree: FloatingTree) -> xr.Dataset:
    """With a base that stands still, so that the joints alone decide on the band."""
    none = ("time", np.zeros(dataset.sizes["time"]))
    return dataset.assign({f"{kind}.{j.name}": none for j in tree.joints[:CARRIERS] for kind in ("q", "tau")})


def _experiment(motion: Motion, tree: FloatingTree) -> Experiment:
    return Experiment(motion, RigidBody(tree))


def _path(dataset: xr.Dataset, motion: Motion, tree: FloatingTree) -> JointPath:
    """What is given, at the motion's samples."""
    time = dataset["time"].values
    given, wheels = (
        np.stack([np.interp(motion.time, time, x) for x in rows.T], 1)
        for rows in (outside(dataset, tree), told(dataset))
    )
    q, qd, qdd = (x[:, CARRIERS:] for x in (motion.q, motion.qd, motion.qdd))
    return JointPath(motion.time, q, qd, qdd, given, wheels, wheel_impulse(dataset, motion))


def _inertia(assembly: TorqueModel, theta: Array) -> Array:
    """Inertial parameters of all links (10 L,), with what effects at links add."""
    phi, tree = assembly.phi.copy(), assembly.tree
    for k, p in enumerate(assembly.placed):
        if p.effect.at == "link":
            link = assembly.joint_of(p)
            own = tree.links[link].phi
            read = {"phi": own[None], "tip": far_end(tree, link)[None]}
            phi[10 * link : 10 * link + 10] += (
                evaluate_law(p.effect, read, assembly.parameters(k, theta)).values[0] - own
            )
    return phi


def _pose(dataset: xr.Dataset, tree: FloatingTree, row: int, recorded: bool) -> tuple[Array, Array]:
    """Position and quaternion of the base in a row; a position that is not recorded is the world's origin."""
    here = [f"pos.{tree.body}.{axis}" for axis in "xyz"]
    place = np.array([float(dataset[name][row]) if name in dataset else 0.0 for name in here])
    if not recorded:
        return place, np.array([1.0, 0.0, 0.0, 0.0])
    return place, np.array([float(dataset[f"quat.{tree.body}.{axis}"][row]) for axis in QUATERNION])


def _with_base(motion: Motion, found: BaseTrajectory) -> Motion:
    """The motion with the base's own in its carriers; nothing acts on them but what effects give."""
    q, qd, qdd, tau = (x.copy("F") for x in (motion.q, motion.qd, motion.qdd, motion.tau))
    x, y, z = found.twist[:, 3:].T
    q[:, :CARRIERS], tau[:, :CARRIERS] = 0.0, 0.0
    qd[:, :CARRIERS], qdd[:, :CARRIERS] = found.twist, found.acceleration
    # Each carrier's axis is turned by those before it.
    qdd[:, 3:CARRIERS] -= np.stack([y * z, -x * z, x * y], 1)
    return replace(motion, q=q, qd=qd, qdd=qdd, tau=tau)


def _table(
    model: Model, tree: FloatingTree, path: JointPath, found: BaseTrajectory, tau: Array, motion: Motion
) -> xr.Dataset:
    columns = {}
    for name, x in (("q", path.q), ("qd", path.qd), ("qdd", path.qdd), ("tau", tau[:, CARRIERS:])):
        columns |= {f"{name}.{joint}": x[:, c] for c, joint in enumerate(model.joints[CARRIERS:])}
    turned = Rotation.from_quat(found.quaternion, scalar_first=True)
    vectors = {
        "pos": found.position,
        "vel": turned.apply(found.twist[:, :3]),
        "omega": turned.apply(found.twist[:, 3:]),
    }
    columns |= {f"{kind}.{tree.body}.{a}": x[:, c] for kind, x in vectors.items() for c, a in enumerate("xyz")}
    columns |= {f"quat.{tree.body}.{a}": found.quaternion[:, c] for c, a in enumerate(QUATERNION)}
    for kind, x in (("force." + tree.body, path.outside[:, :3]), ("torque." + tree.body, path.outside[:, 3:])):
        columns |= {f"{kind}.{a}": x[:, c] for c, a in enumerate("xyz") if x.any()}
    if path.wheels.any():
        columns |= {f"torque.wheels.{a}": path.wheels[:, c] for c, a in enumerate("xyz")}
    variables = {name: ("time", np.ascontiguousarray(x)) for name, x in columns.items()}
    return xr.Dataset(variables, coords={"time": path.time}, attrs={"path": motion.path, "notes": list(motion.notes)})
