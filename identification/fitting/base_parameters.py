"""Base inertial parameters: the combinations of links' inertial parameters on which joint torque depends.

Torque is linear in the standard parameters phi (10 * L,), but its regressor W has dependent columns: a mass on a
revolute axis may as well belong to the link before. Columns are taken in turn, links from the base to the tip, and in a
link mass, first moments, inertias; one is kept where it is independent of those kept before (Gautier 1991). With
``W = W[:, kept] @ B`` the torque is ``W[:, kept] @ beta``, ``beta = B @ phi``. What can be regrouped thus moves towards
the base, as in the closed form of Gautier & Khalil (1990), and masses stay only where a prismatic joint shows them.

W is analytic in the motion, so its rank is the same on any travel, however short. So the rank is computed on motions of
whole turns, where it shows most clearly, and not within joint limits.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.inertia import Array
from ...models.rigid_body import RigidBody
from ...models.tree import Tree

INERTIAL = ("mass", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
"""Names of a link's ten inertial parameters about its own frame."""

UNITS = ("kg", "kg*m", "kg*m", "kg*m") + 6 * ("kg*m^2",)
"""Their units."""

TOLERANCE = 1e-5
"""Share of the largest column below which a column counts as dependent: right angles may be written as 1.5708."""


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """Independent columns of the regressor, and the combinations of standard parameters that they multiply.

    Parameters
    ----------
    columns : array (n_base,) of int
        Kept columns, ascending: torque is ``regressor[:, :, columns] @ beta``.
    matrix : array (n_base, 10 * L)
        B, with ``beta = B @ phi``; the identity in ``columns``.
    names : tuple of (link, parameter, combination)
        The kept parameter (``mass``, first moments ``mx my mz``, inertias ``Ixx`` to ``Izz`` about the link's frame),
        and the sum that is identified in its place, such as ``Izz[upper] + 0.25*mass[fore]``.
    units : tuple of str
        Of each kept parameter: ``kg``, ``kg*m`` or ``kg*m^2``.
    """

    columns: NDArray[np.int_]
    matrix: Array
    names: tuple[tuple[str, str, str], ...]
    units: tuple[str, ...]


def base_parameters(body: RigidBody, seed: int = 0) -> BaseParameters:
    """Base parameters of a tree in its own gravity (Gautier 1991).

    Parameters
    ----------
    body : RigidBody
        Its inertia is not used; its gravity is.
    seed : int
        Of the random motions.
    """
    tree = body.tree
    length = _length(tree)
    size = np.tile(np.repeat([1.0, length, length**2], [1, 3, 6]), len(tree.links))
    regressor = _regressor(body, length, np.random.default_rng(seed)) * size
    columns = _independent(regressor)
    matrix = np.linalg.lstsq(regressor[:, columns], regressor, rcond=None)[0]
    matrix[np.abs(matrix) < 1e-11] = 0.0
    matrix[:, columns] = np.eye(len(columns))
    shown = np.abs(matrix) > TOLERANCE
    matrix = matrix * size[columns, None] / size
    standard = [(link.name, name) for link in tree.links for name in INERTIAL]
    return BaseParameters(
        columns,
        matrix,
        tuple(
            (*standard[own], _combination(own, np.where(seen, row, 0.0), standard))
            for own, row, seen in zip(columns, matrix, shown, strict=True)
        ),
        tuple(UNITS[own % 10] for own in columns),
    )


def _length(tree: Tree) -> float:
    """Longest step from joint to joint [m], 1 where there is none: it makes kg, kg·m and kg·m² comparable."""
    steps = [float(np.linalg.norm(joint.translation)) for joint in tree.joints if joint.parent >= 0]
    return max(steps, default=0.0) or 1.0


def _regressor(body: RigidBody, length: float, rng: np.random.Generator) -> Array:
    """Regressor (n * J, 10 * L) on random motion as vivid as gravity is, forces times length as moments are."""
    joints = body.tree.joints
    reach = np.array([np.pi if joint.kind == "revolute" else length for joint in joints])
    unit = np.array([1.0 if joint.kind == "revolute" else length for joint in joints])
    rate_squared = float(np.linalg.norm(body.tree.gravity)) / length or 1.0
    shape = (20 * len(joints) + 20, len(joints))
    q = rng.uniform(-reach, reach, shape)
    qd = rng.normal(size=shape) * unit * np.sqrt(rate_squared)
    qdd = rng.normal(size=shape) * unit * rate_squared
    carriers = body.tree.carriers
    q[:, :carriers] = 0.0
    regressor = body.regressor(q, qd, qdd) * (length / unit)[:, None]
    regressor[:, :, : 10 * max(carriers - 1, 0)] = 0.0  # a floating base's carriers have no bodies
    return regressor.reshape(-1, regressor.shape[-1]) / np.sqrt(len(q))


def _independent(regressor: Array) -> NDArray[np.int_]:
    """Columns that are independent of those kept before them (Gram–Schmidt, each twice)."""
    smallest = TOLERANCE * np.linalg.norm(regressor, axis=0).max()
    basis, kept = np.empty((len(regressor), 0)), []
    for index, column in enumerate(regressor.T):
        for _ in range(2):
            column = column - basis @ (basis.T @ column)
        norm = np.linalg.norm(column)
        if norm > smallest:
            basis = np.column_stack([basis, column / norm])
            kept.append(index)
    return np.array(kept, int)


def _combination(own: int, row: Array, standard: list[tuple[str, str]]) -> str:
    """The sum in words, the kept parameter first; four digits make near-integers integers."""
    text = ""
    for index in [own, *(i for i in np.flatnonzero(row) if i != own)]:
        link, name = standard[index]
        sign, factor = "-" if row[index] < 0 else "+", f"{abs(row[index]):.4g}"
        text += f" {sign} {name}[{link}]" if factor == "1" else f" {sign} {factor}*{name}[{link}]"
    return text.removeprefix(" + ")
