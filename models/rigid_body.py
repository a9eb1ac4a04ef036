"""Joint torque of a tree of rigid bodies, over many samples: recursive Newton–Euler in CasADi.

The recursion (Luh, Walker, Paul 1980; Featherstone 2008, table 5.1) runs in link frames. Each link's wrench is written
as a matrix times its ten inertial parameters (Atkeson, An, Hollerbach 1986), so torque and regressor are one formula.
Letters: n samples, J joints, L links (one a joint, then one a follower), q position [rad or m], tau torque or force
[N·m or N], phi inertial parameters (10 * L,) as in `snarelab.models.inertia`. A follower's link moves with its leader,
and what it takes is felt there, by the principle of virtual work.
"""

from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from .compiled import SampleFunction
from .inertia import Array
from .regressor import Regressor
from .rotation import exact, turn
from .tree import Tree


class _Motion(NamedTuple):
    """A link's motion in its own frame, and its pose on the parent.

    ``curvature`` (3, 3) takes a body-fixed arm to its acceleration: skew(spin_rate) + skew(spin)².
    """

    rotation: ca.SX
    translation: ca.SX
    spin: ca.SX
    spin_rate: ca.SX
    acceleration: ca.SX
    curvature: ca.SX


def _curvature(spin: ca.SX, spin_rate: ca.SX) -> ca.SX:
    x, y, z = ca.vertsplit(spin)
    dx, dy, dz = ca.vertsplit(spin_rate)
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    return ca.blockcat([[-(yy + zz), xy - dz, xz + dy], [xy + dz, -(xx + zz), yz - dx], [xz - dy, yz + dx, -(xx + yy)]])


def _motions(tree: Tree, q: ca.SX, qd: ca.SX, qdd: ca.SX, gravity: ca.SX) -> list[_Motion]:
    """Outward recursion; gravity enters as an upward acceleration of the base."""
    none = ca.SX(3, 1)
    base = _Motion(ca.SX.eye(3), none, none, none, -gravity, ca.SX(3, 3))
    motions: list[_Motion] = []
    for joint, i, times, offset in tree.bodies:
        parent = base if joint.parent < 0 else motions[joint.parent]
        axis, fixed, arm = exact(joint.axis), exact(joint.rotation), exact(joint.translation)
        place, rate, second = q[i] * times + offset, qd[i] * times, qdd[i] * times
        if joint.kind == "revolute":
            rotation = fixed @ turn(joint.axis, place)
        else:
            rotation, arm = fixed, arm + fixed @ axis * place
        spin, spin_rate = rotation.T @ parent.spin, rotation.T @ parent.spin_rate
        acceleration = rotation.T @ (parent.acceleration + parent.curvature @ arm)
        if joint.kind == "revolute":
            spin_rate = spin_rate + ca.cross(spin, axis * rate) + axis * second
            spin = spin + axis * rate
        else:
            acceleration = acceleration + 2 * ca.cross(spin, axis * rate) + axis * second
        motions.append(_Motion(rotation, arm, spin, spin_rate, acceleration, _curvature(spin, spin_rate)))
    return motions


def _wrench_matrix(motion: _Motion) -> tuple[ca.SX, ca.SX]:
    """Matrices (3, 10) that give a link's force and moment about its frame's origin from its phi."""
    x, y, z = ca.vertsplit(motion.spin)
    dx, dy, dz = ca.vertsplit(motion.spin_rate)
    xy, xz, yz, u = x * y, x * z, y * z, motion.curvature
    of_inertia = ca.blockcat(
        [
            [dx, -u[2, 0], u[1, 0], -yz, u[1, 1] - u[2, 2], yz],
            [xz, u[2, 1], u[2, 2] - u[0, 0], dy, -u[0, 1], -xz],
            [-xy, u[0, 0] - u[1, 1], -u[1, 2], xy, u[0, 2], dz],
        ]
    )
    force = ca.horzcat(motion.acceleration, u, ca.SX(3, 6))
    moment = ca.horzcat(ca.SX(3, 1), -ca.skew(motion.acceleration), of_inertia)
    return force, moment


def symbolic_torque(tree: Tree, q: ca.SX, qd: ca.SX, qdd: ca.SX, gravity: ca.SX, phi: ca.SX) -> ca.SX:
    """Torque tau (J,) that moves the tree so: Newton–Euler outward, then forces and moments summed inward.

    Parameters
    ----------
    tree : Tree
        Kinematics; its own inertia and gravity are not used.
    q, qd, qdd : casadi.SX (J,)
    gravity : casadi.SX (3,)
        In the world frame [m/s²].
    phi : casadi.SX (10 * L,)
    """
    motions = _motions(tree, q, qd, qdd, gravity)
    matrices = [_wrench_matrix(motion) for motion in motions]
    forces = [force @ phi[10 * i : 10 * i + 10] for i, (force, _) in enumerate(matrices)]
    moments = [moment @ phi[10 * i : 10 * i + 10] for i, (_, moment) in enumerate(matrices)]
    torque = ca.SX(tree.n_joints, 1)
    for i, (joint, own, times, _) in reversed(list(enumerate(tree.bodies))):
        motion = motions[i]
        torque[own] += times * ca.dot(exact(joint.axis), moments[i] if joint.kind == "revolute" else forces[i])
        if joint.parent >= 0:
            on_parent = motion.rotation @ forces[i]
            forces[joint.parent] += on_parent
            moments[joint.parent] += motion.rotation @ moments[i] + ca.cross(motion.translation, on_parent)
    return torque


def _symbolic_regressor(tree: Tree, q: ca.SX, qd: ca.SX, qdd: ca.SX, gravity: ca.SX) -> ca.SX:
    """Each joint's unit twist, carried outward, times the wrench matrix of each link that it moves (10 F, 1)."""
    motions = _motions(tree, q, qd, qdd, gravity)
    matrices = [_wrench_matrix(motion) for motion in motions]
    bodies, none = tree.bodies, ca.SX(3, 1)
    blocks = [[ca.SX(1, 10) for _ in bodies] for _ in tree.joints]
    for j in range(tree.n_joints):
        twists: dict[int, tuple[ca.SX, ca.SX]] = {}
        for i, (joint, own, times, _) in enumerate(bodies):
            motion = motions[i]
            if joint.parent in twists:
                turn, slide = twists[joint.parent]
                twists[i] = (motion.rotation.T @ turn, motion.rotation.T @ (slide + ca.cross(turn, motion.translation)))
            if own == j:
                axis, (turn, slide) = exact(joint.axis) * times, twists.get(i, (none, none))
                twists[i] = (turn + axis, slide) if joint.kind == "revolute" else (turn, slide + axis)
            if i in twists:
                force, moment = matrices[i]
                turn, slide = twists[i]
                blocks[j][i] = turn.T @ moment + slide.T @ force
    return ca.vertcat(*(blocks[j][i].T for j, i in zip(*np.nonzero(tree.moves), strict=True)))


class RigidBody:
    """Torque, regressor, mass matrix and tangent of a `Tree`, each compiled when it is first asked for.

    Every method takes arrays of shape (n, J), and raises InputError where a shape does not fit or a number is not
    finite. ``phi`` (10 * L,) stands in for the tree's inertial parameters, ``gravity`` (3,) for its gravity [m/s²].
    """

    def __init__(self, tree: Tree) -> None:
        """Keep the tree; nothing is built yet."""
        self.tree = tree

    def torque(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        phi: ArrayLike | None = None,
        gravity: ArrayLike | None = None,
    ) -> Array:
        """Torque tau (n, J) [N·m or N] that the joints must deliver: M(q) qdd + C(q, qd) qd + g(q)."""
        return self._torque(*self._motion(q=q, qd=qd, qdd=qdd), self._gravity(gravity), self._phi(phi))[0][:, :, 0]

    def regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, gravity: ArrayLike | None = None) -> Array:
        """Matrix (n, J, 10 * L) with ``torque = regressor @ phi``."""
        return self.packed_regressor(q, qd, qdd, gravity).dense()

    def packed_regressor(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, gravity: ArrayLike | None = None
    ) -> Regressor:
        """`regressor` without what is zero whatever the motion."""
        (values,) = self._regressor(*self._motion(q=q, qd=qd, qdd=qdd), self._gravity(gravity))
        return Regressor(values[:, :, 0], self.tree.moves)

    def mass_matrix(self, q: ArrayLike, phi: ArrayLike | None = None) -> Array:
        """Mass matrix M(q) (n, J, J) [kg·m², kg·m or kg]."""
        return self._mass_matrix(*self._motion(q=q), self._phi(phi))[0]

    def tangent(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        phi: ArrayLike | None = None,
        gravity: ArrayLike | None = None,
    ) -> tuple[Array, Array]:
        """Exact derivatives of the torque with respect to q and to qd, each (n, J, J)."""
        by_q, by_qd = self._tangent(*self._motion(q=q, qd=qd, qdd=qdd), self._gravity(gravity), self._phi(phi))
        return by_q, by_qd

    @cached_property
    def _torque(self) -> SampleFunction:
        q, qd, qdd, gravity, phi = symbols = self._symbols()
        return _samples("torque", symbols, symbolic_torque(self.tree, q, qd, qdd, gravity, phi))

    @cached_property
    def _regressor(self) -> SampleFunction:
        q, qd, qdd, gravity, _ = self._symbols()
        return _samples("regressor", [q, qd, qdd, gravity], _symbolic_regressor(self.tree, q, qd, qdd, gravity))

    @cached_property
    def _mass_matrix(self) -> SampleFunction:
        q, qd, qdd, gravity, phi = self._symbols()
        inertial = symbolic_torque(self.tree, q, ca.SX(*qd.shape), qdd, ca.SX(*gravity.shape), phi)
        return _samples("mass_matrix", [q, phi], ca.jacobian(inertial, qdd))

    @cached_property
    def _tangent(self) -> SampleFunction:
        q, qd, qdd, gravity, phi = symbols = self._symbols()
        torque = symbolic_torque(self.tree, q, qd, qdd, gravity, phi)
        return _samples("tangent", symbols, ca.jacobian(torque, q), ca.jacobian(torque, qd))

    def _symbols(self) -> list[ca.SX]:
        n_joints = self.tree.n_joints
        sizes = {"q": n_joints, "qd": n_joints, "qdd": n_joints, "gravity": 3, "phi": 10 * len(self.tree.links)}
        return [ca.SX.sym(name, size) for name, size in sizes.items()]

    def _motion(self, **given: ArrayLike) -> list[Array]:
        """Arrays (n, J) of one length, all finite."""
        n_joints = self.tree.n_joints
        arrays = {name: np.asarray(value, float) for name, value in given.items()}
        n_samples = len(next(iter(arrays.values()))) if next(iter(arrays.values())).ndim else 0
        for name, array in arrays.items():
            if array.shape != (n_samples, n_joints):
                raise InputError(
                    f"{self.tree.name}: {name} has shape {array.shape}; give (n_samples, {n_joints}), "
                    "one column per joint and the same number of samples in all"
                )
            if not np.isfinite(array).all():
                row, column = np.argwhere(~np.isfinite(array))[0]
                raise InputError(
                    f"{self.tree.name}: {name} of joint '{self.tree.joints[column].name}' is {array[row, column]} "
                    f"in row {row}; drop or mend that sample"
                )
        return list(arrays.values())

    def _phi(self, phi: ArrayLike | None) -> Array:
        return self._constant("phi", self.tree.phi if phi is None else phi, 10 * len(self.tree.links))

    def _gravity(self, gravity: ArrayLike | None) -> Array:
        return self._constant("gravity", self.tree.gravity if gravity is None else gravity, 3)

    def _constant(self, name: str, value: ArrayLike, size: int) -> Array:
        array = np.asarray(value, float)
        if array.shape != (size,) or not np.isfinite(array).all():
            raise InputError(f"{self.tree.name}: {name} has shape {array.shape}; give {size} finite numbers")
        return array


def _samples(name: str, inputs: list[ca.SX], *outputs: ca.SX) -> SampleFunction:
    return SampleFunction(ca.Function(name, inputs, ca.cse(list(outputs))))
