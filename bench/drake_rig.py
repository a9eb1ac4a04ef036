"""A suspension rig in Drake: the same arm, with slings and slide friction put on its bodies as forces by hand."""

# Drake's stubs give its arrays shapes of their own.
# pyright: reportArgumentType=false, reportCallIssue=false, reportReturnType=false
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    MultibodyForces,
    PrismaticJoint,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)

from snarelab.models.inertia import to_central
from snarelab.models.rig.rig import Rig
from snarelab.models.tree import Tree

Array = NDArray[np.float64]
Push = tuple[int, ArrayLike, Array]
"""Link, point in its frame [m], force in the world [N]."""


class DrakeRig:
    """A tree in Drake, and its inverse dynamics under forces on its links."""

    def __init__(self, tree: Tree, gravity: ArrayLike) -> None:
        """Build the plant; gravity (3,) [m/s²]."""
        self.plant = MultibodyPlant(0.0)
        self.plant.mutable_gravity_field().set_gravity_vector(np.asarray(gravity, float))
        self.bodies = []
        for joint, link in zip(tree.joints, tree.links, strict=True):
            mass, com, inertia = to_central(link.phi)
            rotational = RotationalInertia(*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2])
            body = self.plant.AddRigidBody(link.name, SpatialInertia.MakeFromCentralInertia(mass, com, rotational))
            parent = self.plant.world_body() if joint.parent < 0 else self.bodies[joint.parent]
            pose = RigidTransform(RotationMatrix(joint.rotation), joint.translation)
            frame = self.plant.AddFrame(FixedOffsetFrame(f"{joint.name}_frame", parent.body_frame(), pose))
            kind = RevoluteJoint if joint.kind == "revolute" else PrismaticJoint
            self.plant.AddJoint(kind(joint.name, frame, body.body_frame(), joint.axis))
            self.bodies.append(body)
        self.plant.Finalize()
        self._context = self.plant.CreateDefaultContext()
        self._world = self.plant.world_frame()

    def move(self, q: Array, qd: Array) -> None:
        """Put the arm into a state (J,) each."""
        self.plant.SetPositions(self._context, q)
        self.plant.SetVelocities(self._context, qd)

    def turned(self, link: int) -> Array:
        """Rotation (3, 3) of a link's frame to the world."""
        return self.plant.EvalBodyPoseInWorld(self._context, self.bodies[link]).rotation().matrix()

    def velocity(self, link: int, point: ArrayLike) -> Array:
        """Velocity (3,) [m/s] of a point of a link, in the world."""
        twist = self.plant.EvalBodySpatialVelocityInWorld(self._context, self.bodies[link])
        return twist.translational() + np.cross(twist.rotational(), self.turned(link) @ np.asarray(point))

    def torque(self, qdd: Array, pushes: Sequence[Push]) -> Array:
        """Drive torque (J,) in the present state; the order of calls is the one in which Drake keeps the forces."""
        forces = MultibodyForces(self.plant)
        self.plant.CalcForceElementsContribution(self._context, forces)
        for link, point, force in pushes:
            arm = self.turned(link) @ np.asarray(point)
            push = SpatialForce(np.zeros(3), force)
            self.bodies[link].AddInForce(self._context, arm, push, self._world, forces)
        return self.plant.CalcInverseDynamics(self._context, qdd, forces)


def rig_torque(
    rig: Rig,
    motion: tuple[Array, Array, Array],
    friction: Mapping[str, Callable[[float], float]],
    pull: Callable[[str, Array], ArrayLike],
    *,
    under_gravity: bool,
) -> Array:
    """Torque (n, J) of a rig along a motion.

    Parameters
    ----------
    rig : Rig
    motion : q, qd, qdd (n, J)
    friction : mapping of joint to callable
        Force at each slide contact that the joint moves [N], of the joint's speed.
    pull : callable
        ``(sling, velocity of its hang point) -> N``, upward or (3,), beyond the weight that it carries in balance;
        asked sample after sample.
    under_gravity : bool
        Gravity and the slings' whole weights, or neither.
    """
    drake = DrakeRig(rig, rig.gravity if under_gravity else np.zeros(3))
    up = np.array([0.0, 0.0, 1.0])
    found = []
    for q, qd, qdd in zip(*motion, strict=True):
        drake.move(q, qd)
        pushes: list[Push] = []
        for sling in rig.slings:
            beyond = np.asarray(pull(sling.name, drake.velocity(sling.link, sling.point)))
            force = (beyond if beyond.shape else beyond * up) + under_gravity * sling.weight * up
            if force.any():
                pushes.append((sling.link, sling.point, force))
            joint = rig.joints[sling.link]
            for contact in sling.slide if joint.name in friction else ():
                way = np.cross(joint.axis, contact) if joint.kind == "revolute" else joint.axis
                against = -friction[joint.name](qd[sling.link]) * (drake.turned(sling.link) @ way) / np.linalg.norm(way)
                pushes.append((sling.link, contact, against))
        found.append(drake.torque(qdd, pushes))
    return np.array(found)
