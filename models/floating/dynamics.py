"""Inertia, Jacobians and momentum of an arm on a floating base, as plain functions over many samples.

Letters: n samples, J joints. ``q`` and ``qd`` (n, J) are joint positions and rates [rad or m, and per s]; ``twist``
(n, 6) is the base's: velocity of the base frame's origin, then angular velocity [m/s, rad/s]. **Everything is in the
base's frame**, so that nothing depends on the base's attitude; `in_world` turns vectors. Linear parts stand before
angular ones. Every function raises InputError where a shape does not fit or a number is not finite.

Sources: Umetani and Yoshida (1989), Resolved motion rate control of space manipulators with generalized Jacobian
matrix; Wang, Luo and Ma (2011), eqs 3-8, whose letters are kept: H_b, H_bm, H_m, J_b, J_m, J*.
"""

from functools import cached_property, lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ..compiled import SampleFunction
from ..inertia import Array
from . import symbols
from .arm import FloatingArm

SINGULAR = 1e6
"""Condition number of a Jacobian from which on it has no inverse worth using."""


class TipPose(NamedTuple):
    """Rotation (n, 3, 3) and translation (n, 3) [m] of the tip's frame in the base's."""

    rotation: Array
    translation: Array


def base_inertia(arm: FloatingArm, q: ArrayLike) -> Array:
    """H_b (n, 6, 6): inertia of the whole system, joints locked, about the base frame's origin."""
    return inertia(arm, q)[:, :6, :6]


def coupling_inertia(arm: FloatingArm, q: ArrayLike) -> Array:
    """H_bm (n, 6, J): momentum of the whole system per joint rate, base at rest."""
    return inertia(arm, q)[:, :6, 6:]


def joint_inertia(arm: FloatingArm, q: ArrayLike) -> Array:
    """H_m (n, J, J): the arm's mass matrix on a base that stands still."""
    return inertia(arm, q)[:, 6:, 6:]


def inertia(arm: FloatingArm, q: ArrayLike) -> Array:
    """H (n, 6 + J, 6 + J) = [[H_b, H_bm], [H_bm^T, H_m]]; kinetic energy is half of [twist, qd] H [twist, qd]."""
    return _compiled(arm).inertia(*_joints(arm, q=q))[0]


def generalized_inertia(arm: FloatingArm, q: ArrayLike) -> Array:
    """H* (n, J, J) = H_m - H_bm^T H_b^-1 H_bm: what a joint torque feels when the base is free to move.

    On a base that stands still it is H_m.
    """
    whole = inertia(arm, q)
    coupling = whole[:, :6, 6:]
    if not arm.floating:
        return whole[:, 6:, 6:]
    return whole[:, 6:, 6:] - coupling.transpose(0, 2, 1) @ np.linalg.solve(whole[:, :6, :6], coupling)


def tip_pose(arm: FloatingArm, q: ArrayLike) -> TipPose:
    """Pose of the tip on the base."""
    rotation, translation, _, _ = _compiled(arm).tip(*_joints(arm, q=q))
    return TipPose(rotation, translation[:, :, 0])


def link_origins(arm: FloatingArm, q: ArrayLike) -> Array:
    """Origins (n, J, 3) of the links' frames, where the joints are, in the base's frame [m]."""
    return _compiled(arm).origins(*_joints(arm, q=q))[0]


def tip_jacobians(arm: FloatingArm, q: ArrayLike) -> tuple[Array, Array]:
    """J_b (n, 6, 6) and J_m (n, 6, J): the tip's twist, seen in the base's frame, is J_b twist + J_m qd (eq. 3)."""
    _, _, by_base, by_joints = _compiled(arm).tip(*_joints(arm, q=q))
    return by_base, by_joints


def generalized_jacobian(arm: FloatingArm, q: ArrayLike) -> Array:
    """J* (n, 6, J) = J_m - J_b H_b^-1 H_bm: the tip's twist per joint rate where the total momentum is zero.

    On a base that stands still it is J_m.
    """
    by_base, by_joints = tip_jacobians(arm, q)
    if not arm.floating:
        return by_joints
    whole = inertia(arm, q)
    return by_joints - by_base @ np.linalg.solve(whole[:, :6, :6], whole[:, :6, 6:])


def joint_rates(arm: FloatingArm, q: ArrayLike, tip_twist: ArrayLike) -> Array:
    """Joint rates (n, J) that move the tip with ``tip_twist`` (n, 6), seen in the base's frame, at zero momentum.

    The smallest such rates for more than six joints. Raises InputError where the arm is singular, or has fewer than
    six joints: the twist then cannot be had.
    """
    jacobian = generalized_jacobian(arm, q)
    wanted = np.asarray(tip_twist, float)
    if wanted.shape != (len(jacobian), 6) or not np.isfinite(wanted).all():
        raise InputError(f"{arm.tree.name}: tip_twist has shape {wanted.shape}; give ({len(jacobian)}, 6), all finite")
    if arm.n_joints < 6:
        raise InputError(
            f"{arm.tree.name}: {arm.n_joints} joints cannot give the tip any twist; give at least six, or "
            "solve generalized_jacobian(...) for the directions that matter"
        )
    strengths = np.linalg.svd(jacobian, compute_uv=False)
    worst = int(np.argmax(strengths[:, 0] / np.maximum(strengths[:, -1], 1e-300)))
    if strengths[worst, -1] * SINGULAR < strengths[worst, 0]:
        at = ", ".join(f"{x:.6g}" for x in np.asarray(q, float)[worst])
        raise InputError(
            f"{arm.tree.name}: the arm is singular in row {worst} at q = [{at}]: its generalised Jacobian has the "
            f"singular values {strengths[worst, 0]:.3g} to {strengths[worst, -1]:.3g} and no inverse; move a joint"
        )
    return np.einsum("nji,ni->nj", np.linalg.pinv(jacobian), wanted)


def momentum(arm: FloatingArm, q: ArrayLike, twist: ArrayLike, qd: ArrayLike) -> Array:
    """Momentum (n, 6) of base and arm: linear [N·s], then angular about the base frame's origin [N·m·s] (eq. 6)."""
    return _compiled(arm).momentum(*_joints_and_twist(arm, q, twist, qd))[0][:, :, 0]


def world_momentum(
    arm: FloatingArm, position: ArrayLike, quaternion: ArrayLike, q: ArrayLike, twist: ArrayLike, qd: ArrayLike
) -> Array:
    """Momentum (n, 6) in the world frame: linear, then angular about the **world's** origin; what is conserved.

    ``position`` (n, 3) [m] and ``quaternion`` (n, 4; w, x, y, z) are the base's pose in the world.
    """
    own = momentum(arm, q, twist, qd)
    linear, angular = in_world(quaternion, own[:, :3]), in_world(quaternion, own[:, 3:])
    return np.hstack([linear, angular + np.cross(np.asarray(position, float), linear)])


def base_twist(arm: FloatingArm, q: ArrayLike, qd: ArrayLike, total: ArrayLike | None = None) -> Array:
    """The base's twist (n, 6) that a momentum asks for: H_b^-1 (total - H_bm qd), zero for a base that stands still.

    ``total`` (n, 6) as from `momentum`; none: zero.
    """
    positions, rates = _joints(arm, q=q, qd=qd)
    if not arm.floating:
        return np.zeros((len(positions), 6))
    whole = inertia(arm, positions)
    wanted = np.zeros((len(positions), 6)) if total is None else np.asarray(total, float)
    rest = wanted[:, :, None] - whole[:, :6, 6:] @ rates[:, :, None]
    return np.asarray(np.linalg.solve(whole[:, :6, :6], rest)[:, :, 0], np.float64)


def kinetic_energy(arm: FloatingArm, q: ArrayLike, twist: ArrayLike, qd: ArrayLike) -> Array:
    """Kinetic energy (n,) of base and arm [J]."""
    positions, motion, rates = _joints_and_twist(arm, q, twist, qd)
    whole = np.hstack([motion, rates])
    return 0.5 * np.einsum("ni,nij,nj->n", whole, inertia(arm, positions), whole)


def inverse_dynamics(
    arm: FloatingArm, q: ArrayLike, twist: ArrayLike, qd: ArrayLike, acceleration: ArrayLike, qdd: ArrayLike
) -> Array:
    """What must act for a motion: force and moment on the base about its frame's origin, and joint torques (n, 6 + J).

    The first six are the rate of the total momentum, zero where nothing acts from outside (eq. 8). ``acceleration``
    (n, 6) is the base's: of its frame's origin and angular, as an observer at rest sees them, along the base's axes.
    Gravity is the tree's, which only a base that stands still has.
    """
    n = len(_checked(arm, "q", q, arm.n_joints, None))
    names = {
        "twist": (twist, 6),
        "qd": (qd, arm.n_joints),
        "acceleration": (acceleration, 6),
        "qdd": (qdd, arm.n_joints),
    }
    rest = [_checked(arm, name, value, columns, n) for name, (value, columns) in names.items()]
    return _compiled(arm).inverse(np.asarray(q, float), *rest)[0][:, :, 0]


def in_world(quaternion: ArrayLike, vectors: ArrayLike) -> Array:
    """Vectors (n, 3) of the base's frame turned into the world's by its attitude (n, 4; w, x, y, z)."""
    return Rotation.from_quat(np.asarray(quaternion, float), scalar_first=True).apply(np.asarray(vectors, float))


class _Functions:
    """Compiled expressions of one arm, each when it is first asked for."""

    def __init__(self, arm: FloatingArm) -> None:
        self._arm = arm
        self._q, self._qd, self._qdd = (ca.SX.sym(name, arm.n_joints) for name in ("q", "qd", "qdd"))
        self._twist, self._acceleration = ca.SX.sym("twist", 6), ca.SX.sym("acceleration", 6)

    @cached_property
    def inertia(self) -> SampleFunction:
        return _samples("inertia", [self._q], [symbols.inertia(self._arm, self._q)])

    @cached_property
    def tip(self) -> SampleFunction:
        return _samples("tip", [self._q], list(symbols.tip(self._arm, self._q)))

    @cached_property
    def origins(self) -> SampleFunction:
        places = [place for _, place in symbols.poses(self._arm, self._q)]
        return _samples("origins", [self._q], [ca.horzcat(*places).T])

    @cached_property
    def momentum(self) -> SampleFunction:
        own = symbols.inertia(self._arm, self._q)[:6, :] @ ca.vertcat(self._twist, self._qd)
        return _samples("momentum", [self._q, self._twist, self._qd], [own])

    @cached_property
    def inverse(self) -> SampleFunction:
        gravity = ca.SX(ca.DM(self._arm.tree.gravity))
        acting = symbols.inertia(self._arm, self._q) @ ca.vertcat(self._acceleration, self._qdd)
        acting += symbols.bias(self._arm, self._q, self._twist, self._qd, gravity)
        inputs = [self._q, self._twist, self._qd, self._acceleration, self._qdd]
        return _samples("inverse", inputs, [acting])


@lru_cache(maxsize=32)
def _compiled(arm: FloatingArm) -> _Functions:
    return _Functions(arm)


def _samples(name: str, inputs: list[ca.SX], outputs: list[ca.SX]) -> SampleFunction:
    return SampleFunction(ca.Function(name, inputs, ca.cse(outputs)))


def _joints(arm: FloatingArm, **given: ArrayLike) -> list[Array]:
    return [_checked(arm, name, value, arm.n_joints, None) for name, value in given.items()]


def _joints_and_twist(arm: FloatingArm, q: ArrayLike, twist: ArrayLike, qd: ArrayLike) -> list[Array]:
    positions = _checked(arm, "q", q, arm.n_joints, None)
    return [
        positions,
        _checked(arm, "twist", twist, 6, len(positions)),
        _checked(arm, "qd", qd, arm.n_joints, len(positions)),
    ]


def _checked(arm: FloatingArm, name: str, value: ArrayLike, columns: int, rows: int | None) -> Array:
    array = np.asarray(value, float)
    wanted = f"({'n_samples' if rows is None else rows}, {columns})"
    if array.ndim != 2 or array.shape[1] != columns or (rows is not None and len(array) != rows):
        what = "one column per joint" if name in ("q", "qd", "qdd") else "linear, then angular"
        raise InputError(f"{arm.tree.name}: {name} has shape {array.shape}; give {wanted}: {what}")
    if not np.isfinite(array).all():
        row, column = np.argwhere(~np.isfinite(array))[0]
        raise InputError(f"{arm.tree.name}: {name} is {array[row, column]} in row {row}, column {column}; drop it")
    return array
