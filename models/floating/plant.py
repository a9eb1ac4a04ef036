"""An arm on a floating base in Drake: the plant, and a run of it under a position servo on every joint.

Inertias go to Drake as they are: its own check, and the silent replacement by its URDF parser, are both passed by.
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false
# (Drake's type stubs want a scalar for the shape of an array, and a System for what a builder hands back)
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ..inertia import Array
from .arm import FloatingArm


@dataclass(frozen=True, eq=False)
class PlantRun:
    """A simulated motion, at the steps that the integrator took.

    Parameters
    ----------
    time : array (n,)
        [s]
    position, quaternion : array (n, 3), (n, 4)
        Pose of the base in the world [m; w, x, y, z].
    velocity, spin : array (n, 3)
        Twist of the base in the **world** frame [m/s, rad/s].
    q, qd : array (n, J)
        Joint positions and rates [rad or m, and per s].
    """

    time: Array
    position: Array
    quaternion: Array
    velocity: Array
    spin: Array
    q: Array
    qd: Array

    @cached_property
    def twist(self) -> Array:
        """Twist of the base in its own frame (n, 6), as `dynamics` wants it."""
        back = Rotation.from_quat(self.quaternion, scalar_first=True).inv()
        return np.hstack([back.apply(self.velocity), back.apply(self.spin)])

    def at(self, time: ArrayLike) -> tuple[Array, Array]:
        """Joint positions and rates (n, J) at other times [s], by cubics through positions and rates."""
        curve = CubicHermiteSpline(self.time, self.q, self.qd)
        return curve(time), curve.derivative()(time)


class FloatingPlant:
    """Drake's simulator of one arm, ready to run again and again.

    Parameters
    ----------
    arm : FloatingArm
    stiffness, damping : array (J,)
        Gains of the servo: torque = stiffness * (target - q) - damping * qd [N·m/rad, N·m·s/rad; or N/m, N·s/m].
    accuracy : float
        Of the error-controlled fifth-order Runge-Kutta steps.
    """

    def __init__(self, arm: FloatingArm, stiffness: ArrayLike, damping: ArrayLike, accuracy: float = 1e-8) -> None:
        """Build the diagram; raises InputError where a gain's shape does not fit the joints."""
        from pydrake.systems.analysis import Simulator
        from pydrake.systems.controllers import PidController
        from pydrake.systems.framework import DiagramBuilder
        from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

        kp, kd = joint_vector(arm, "stiffness", stiffness), joint_vector(arm, "damping", damping)
        builder = DiagramBuilder()
        self.arm = arm
        self.plant, self._base, self._joints = _plant(arm)
        builder.AddSystem(self.plant)
        servo = builder.AddSystem(PidController(kp, np.zeros(arm.n_joints), kd))
        self._target: Any = builder.AddSystem(ConstantVectorSource(np.zeros(2 * arm.n_joints)))
        builder.Connect(self.plant.get_state_output_port(self._joints), servo.get_input_port_estimated_state())
        builder.Connect(self._target.get_output_port(), servo.get_input_port_desired_state())
        builder.Connect(servo.get_output_port(), self.plant.get_actuation_input_port(self._joints))
        # without a period the sink writes at each step taken, and the steps stay as long as the error allows
        self._log = LogVectorOutput(self.plant.get_state_output_port(), builder)
        self._simulator: Any = Simulator(builder.Build())
        self._accuracy = accuracy
        self._context: Any = self._simulator.get_mutable_context()
        self._start = self._context.Clone()

    def run(
        self,
        target: ArrayLike,
        duration: float,
        q: ArrayLike | None = None,
        qd: ArrayLike | None = None,
        longest: float = 1.0,
    ) -> PlantRun:
        """Move from positions q and rates qd (J,) (none: zero), base at rest, to ``target`` (J,) for ``duration`` [s].

        Steps are as long as the error allows and at most ``longest`` [s].
        Raises InputError where a shape does not fit the joints, or the duration is not positive.
        """
        from pydrake.systems.analysis import ResetIntegratorFromFlags

        if not np.isfinite(duration) or duration <= 0:
            raise InputError(f"{self.arm.tree.name}: duration is {duration} s; give one above 0")
        wanted = joint_vector(self.arm, "target", target)
        first = [
            joint_vector(self.arm, name, np.zeros(self.arm.n_joints) if value is None else value)
            for name, value in (("q", q), ("qd", qd))
        ]
        self._context.SetTimeStateAndParametersFrom(self._start)
        at = self.plant.GetMyMutableContextFromRoot(self._context)
        self.plant.SetPositions(at, self._joints, first[0])
        self.plant.SetVelocities(at, self._joints, first[1])
        source = self._target.get_mutable_source_value(self._target.GetMyMutableContextFromRoot(self._context))
        source.SetFromVector(np.concatenate([wanted, np.zeros(self.arm.n_joints)]))
        log = self._log.FindMutableLog(self._context)
        log.Clear()
        # a new integrator: the old one would begin with the long steps that the end of the last run allowed
        ResetIntegratorFromFlags(self._simulator, "runge_kutta5", longest).set_target_accuracy(self._accuracy)
        self._simulator.Initialize()
        self._simulator.AdvanceTo(duration)
        return self._read(log.sample_times().copy(), log.data().T.copy())

    def _read(self, time: Array, states: Array) -> PlantRun:
        n_joints, n = self.arm.n_joints, len(time)
        if not self.arm.floating:
            still = np.zeros((n, 3))
            upright = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
            return PlantRun(time, still, upright, still, still, states[:, :n_joints], states[:, n_joints:])
        positions, rates = states[:, : 7 + n_joints], states[:, 7 + n_joints :]
        return PlantRun(
            time,
            positions[:, 4:7],
            positions[:, :4],
            rates[:, 3:6],
            rates[:, :3],
            positions[:, 7:],
            rates[:, 6:],
        )


def joint_vector(arm: FloatingArm, name: str, value: ArrayLike) -> Array:
    """One finite number per joint (J,); raises InputError."""
    array = np.asarray(value, float)
    if array.shape != (arm.n_joints,) or not np.isfinite(array).all():
        raise InputError(
            f"{arm.tree.name}: {name} is {array.tolist()}; give {arm.n_joints} finite numbers, one per joint"
        )
    return array


def _plant(arm: FloatingArm) -> tuple[Any, Any, Any]:
    """Drake's continuous plant, and its model instances of the base and of the arm: joints in the tree's order."""
    from pydrake.math import RigidTransform, RotationMatrix
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RevoluteJoint

    plant: Any = MultibodyPlant(0.0)
    base, joints = plant.AddModelInstance("base"), plant.AddModelInstance("arm")
    plant.mutable_gravity_field().set_gravity_vector(arm.tree.gravity)
    carrier = plant.AddRigidBody("base", base, _spatial_inertia(arm.base))
    bodies: list[Any] = []
    for joint, link in zip(arm.tree.joints, arm.tree.links, strict=True):
        body = plant.AddRigidBody(link.name, joints, _spatial_inertia(link.phi))
        parent = carrier if joint.parent < 0 else bodies[joint.parent]
        pose = RigidTransform(RotationMatrix(joint.rotation), joint.translation)
        at = plant.AddFrame(FixedOffsetFrame(f"{joint.name}_on_parent", parent.body_frame(), pose, joints))
        kind = RevoluteJoint if joint.kind == "revolute" else PrismaticJoint
        plant.AddJointActuator(joint.name, plant.AddJoint(kind(joint.name, at, body.body_frame(), joint.axis)))
        bodies.append(body)
    if not arm.floating:
        plant.WeldFrames(plant.world_frame(), carrier.body_frame())
    plant.Finalize()
    return plant, base, joints


def _spatial_inertia(phi: Array) -> Any:
    """Drake's inertia of phi (10,), unchecked: `FloatingArm` has checked what is to be checked."""
    from pydrake.multibody.tree import SpatialInertia, UnitInertia

    mass = float(phi[0])
    if mass == 0:
        return SpatialInertia(0.0, np.zeros(3), UnitInertia(0.0, 0.0, 0.0), skip_validity_check=True)
    xx, xy, xz, yy, yz, zz = phi[4:] / mass
    return SpatialInertia(mass, phi[1:4] / mass, UnitInertia(xx, yy, zz, xy, xz, yz), skip_validity_check=True)
