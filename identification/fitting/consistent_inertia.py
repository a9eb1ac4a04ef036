"""Physically consistent links behind identified base parameters: the nearest with a possible mass density.

Every link's pseudo-inertia P (4, 4) has to be positive definite (Wensing, Kim, Slotine 2018). P is linear in phi, so
the search is convex and its minimum global:

    min over phi   (beta - B phi)' information (beta - B phi) + weight * sum over links of D(P, P_nominal),
    D(P, Q) = tr(P inv(Q)) - log det(P inv(Q)) - 4.

D is the divergence of Lee, Wensing, Park (2019): zero at the nominal link, the same in every frame and unit, infinite
where P stops being positive definite. It thus is barrier and prior at once, and the weight goes to zero: what the data
show is kept, and what they cannot show comes from the nominal links. Newton's method follows the minimum down that path
(Boyd & Vandenberghe 2004, ch. 11) in coordinates in which D's second derivative is the identity: with ``P = C C'``, a
step is ``C S C'``, S symmetric. Log-Cholesky parameters (Rucker & Wensing 2022) would stay physical by themselves, but
make the search non-convex, and endless where the best body is flat or has no mass: there they go to minus infinity.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular
from scipy.stats import chi2

from ...errors import InputError
from ...models.inertia import Array, from_central, from_pseudo_inertia, nearest_physical, pseudo_inertia, to_central
from .base_parameters import BaseParameters

CONFIDENCE = 0.95
"""Chance that noise alone leaves a physical body's misfit below the limit of `ConsistentInertia.changed`."""

DUMMY_MASS, DUMMY_SIZE = 1e-3, 0.1
"""Mass and radius of gyration given to a nominal link without mass, as shares of all links'."""

THINNEST = 1e-2
"""Least radius of gyration of a nominal link along any axis, as a share of all links'."""

FALL = 0.6
"""Of the prior's weight from one minimum to the next: near enough for whole Newton steps."""

ENOUGH = 1e-9, 1e-16
"""Weight at which the search ends, as a share of the misfit, and of the misfit that no body at all would leave."""

FLATTEST = 1e-11
"""(Thickness / size)² of a link at which the search ends too: inertias (10,) have no digits for less."""

MAX_STEPS = 100
"""Newton steps at one weight."""

_ROW, _COLUMN = np.triu_indices(4)
_SYMMETRIC = np.zeros((10, 4, 4))
_SYMMETRIC[np.arange(10), _ROW, _COLUMN] = np.where(_ROW == _COLUMN, 1.0, 0.5**0.5)
_SYMMETRIC[np.arange(10), _COLUMN, _ROW] = np.where(_ROW == _COLUMN, 1.0, 0.5**0.5)
"""Orthonormal basis of symmetric matrices (4, 4)."""

_TO_PSEUDO = np.array([pseudo_inertia(unit) for unit in np.eye(10)])
_TO_PHI = np.array([from_pseudo_inertia(unit.reshape(4, 4)) for unit in np.eye(16)]).reshape(4, 4, 10)


@dataclass(frozen=True, eq=False)
class ConsistentInertia:
    """Standard parameters that are physically consistent.

    Parameters
    ----------
    phi : array (10 * L,)
        Of all links, every pseudo-inertia positive definite.
    beta_consistent : array (n_base,)
        ``B @ phi``.
    misfit : float
        ``(beta - B phi)' information (beta - B phi)``: with the inverse covariance as information, squared standard
        deviations.
    changed : bool
        Whether the data's own optimum is no physical body, and significantly so: the misfit exceeds what noise alone
        may leave between the data and the true body, the 95 % point of chi-squared with the information's rank as
        degrees of freedom. A smaller misfit is no reason to doubt the data.
    """

    phi: Array
    beta_consistent: Array
    misfit: float
    changed: bool


def consistent_inertia(
    base: BaseParameters, beta: ArrayLike, information: ArrayLike, phi_nominal: ArrayLike
) -> ConsistentInertia:
    """Nearest physically consistent links to identified base parameters.

    A physically possible ``beta`` is met to rounding; of all links that have it, the nearest to the nominal ones are
    taken. Otherwise the misfit is within about 2 % of the least, if the nominal links are within a factor of ten of the
    true ones: the least misfit often needs links that grow without end.

    Parameters
    ----------
    base : BaseParameters
    beta : array (n_base,)
        Identified base parameters.
    information : array (n_base, n_base)
        Inverse of their covariance; zero in directions that the data do not show.
    phi_nominal : array (10 * L,)
        What the links are believed to be. Where they are no bodies, others stand for them: a link without mass gets a
        thousandth of all links' mass and a tenth of their radius of gyration (1 kg and 1 m if none has mass), one
        without thickness a hundredth of that radius, one that breaks the triangle inequality the nearest inertia that
        keeps it.

    Raises
    ------
    InputError
        Where a shape does not fit, a number is not finite, or the information is not that of a covariance.
    """
    n_base, n_standard = base.matrix.shape
    beta = _finite("beta", beta, (n_base,))
    root = _root(_finite("information", information, (n_base, n_base)))
    nominal = _nominal(_finite("phi_nominal", phi_nominal, (n_standard,)))
    if not root.shape[1]:
        return ConsistentInertia(nominal, base.matrix @ nominal, 0.0, False)
    search = _Search(root.T @ base.matrix, root.T @ beta, nominal)
    phi = search.exact()
    if phi is None:
        phi = search.nearest()
    beta_consistent = base.matrix @ phi
    misfit = float(np.sum((root.T @ (beta - beta_consistent)) ** 2))
    return ConsistentInertia(phi, beta_consistent, misfit, bool(misfit > chi2.ppf(CONFIDENCE, root.shape[1])))


class _Search:
    """Newton's method from the nominal links on what the data say, with unit variance: ``matrix @ phi = target``."""

    def __init__(self, matrix: Array, target: Array, nominal: Array) -> None:
        self._matrix, self._target, self._nominal = matrix, target, nominal
        self._inverse_nominal = np.linalg.inv(_pseudo_inertias(nominal))

    def exact(self) -> Array | None:
        """Phi (10 * L,) that meets the target, nearest to the nominal; None where no body does.

        Misfit counts here as what it takes to move the nominal links by it, so that no direction lags behind.
        """
        _, _, seen = self._coordinates(self._nominal)
        cost = solve_triangular(np.linalg.qr(seen.T).R, np.eye(len(seen)))
        for phi in self._path(cost):
            _, by_phi, seen = self._coordinates(phi)
            step = _least_step(seen, self._target - self._matrix @ phi, 0.0)
            met = phi + _moved(by_phi, step)
            if _flatness(met) > FLATTEST:
                return self._newton(met, np.eye(len(seen)), 0.0)
        return None

    def nearest(self) -> Array:
        """Phi (10 * L,) of least misfit."""
        return list(self._path(np.eye(len(self._target))))[-1]

    def _path(self, cost: Array) -> Iterator[Array]:
        """Minima of ``|cost' (target - matrix @ phi)|² + weight * D`` at falling weights.

        It ends where the misfit no longer falls, short of links that grow without end: a little more of it can often
        be explained by ever more mass where mass does not show.
        """
        phi, whole = self._nominal, np.sum((cost.T @ self._target) ** 2)
        misfit = cost.T @ (self._target - self._matrix @ phi)
        # the first Newton step has at most length 1
        weight = 2.0 * float(np.linalg.norm(self._coordinates(phi)[2].T @ cost @ misfit))
        yield phi
        while weight > max(ENOUGH[0] * np.sum(misfit**2), ENOUGH[1] * whole) and _flatness(phi) > FLATTEST:
            phi = self._newton(phi, cost, weight)
            yield phi
            misfit = cost.T @ (self._target - self._matrix @ phi)
            weight *= FALL

    def _newton(self, phi: Array, cost: Array, weight: float) -> Array:
        """Minimum at one weight; at weight 0, of D alone among the bodies that meet the target."""
        for _ in range(MAX_STEPS):
            factor, by_phi, seen = self._coordinates(phi)
            pull = np.swapaxes(factor, 1, 2) @ self._inverse_nominal @ factor - np.eye(4)
            gradient = np.einsum("kab,lab->lk", _SYMMETRIC, pull).ravel()
            measured = cost.T @ seen
            right = cost.T @ (self._target - self._matrix @ phi + seen @ gradient)
            step = _least_step(measured, right, weight) - gradient
            curvature = 2.0 / weight * np.sum((measured @ step) ** 2) if weight else 0.0
            stretch = np.linalg.eigvalsh(np.tensordot(step.reshape(-1, 10), _SYMMETRIC, 1))
            phi = phi + _moved(by_phi, _share(stretch, curvature) * step)
            if step @ step + curvature < 1e-8 or _flatness(phi) < FLATTEST:
                break
        return phi

    def _coordinates(self, phi: Array) -> tuple[Array, Array, Array]:
        """C (J, 4, 4), and the derivatives by S of phi (J, 10, 10) and of what the data see (rank, 10 * J)."""
        factor = np.asarray(np.linalg.cholesky(_pseudo_inertias(phi)), float)
        steps = np.einsum("lab,kbc,ldc->lkad", factor, _SYMMETRIC, factor, optimize=True)
        by_phi = np.tensordot(steps, _TO_PHI, 2)
        seen = np.einsum("blp,lkp->blk", self._matrix.reshape(len(self._matrix), -1, 10), by_phi)
        return factor, by_phi, seen.reshape(len(self._matrix), -1)


def _least_step(measured: Array, right: Array, weight: float) -> Array:
    """Step v (10 * L,) of least ``|right - measured v|² + weight / 2 |v|²``; at weight 0, the least to meet right."""
    n_rows, n_steps = measured.shape
    orthogonal, triangle = np.linalg.qr(np.concatenate([measured.T, np.sqrt(0.5 * weight) * np.eye(n_rows)]))
    return orthogonal[:n_steps] @ solve_triangular(triangle, right, trans=1)


def _share(stretch: Array, curvature: float) -> float:
    """Share of a Newton step to take: the first of 1, ½, ¼ … that grows no tenfold and has not gone uphill.

    With eigenvalues e of S (``stretch``) the slope at share t is ``-(1 - t) curvature - sum e² (1 - t / (1 + t e))``.
    """
    share = 1.0
    while True:
        grown = 1.0 + share * stretch
        if grown.min() > 0.1 and grown.max() < 10.0:
            slope = (share - 1.0) * curvature + np.sum(stretch**2 * (share / grown - 1.0))
            if slope <= 0.5 * (curvature + np.sum(stretch**2)):
                return share
        share *= 0.5


def _moved(by_phi: Array, step: Array) -> Array:
    """Change of phi (10 * L,) with a step (10 * L,)."""
    return np.einsum("lk,lkp->lp", step.reshape(-1, 10), by_phi).ravel()


def _nominal(phi: Array) -> Array:
    """The nominal links, each made a body with some mass and thickness."""
    links = phi.reshape(-1, 10)
    bodies = [link for link in links if link[0] > 0]
    mass_of_all = sum(float(link[0]) for link in bodies)
    second_of_all = sum(float(np.trace(pseudo_inertia(link)[:3, :3])) for link in bodies)
    size = np.sqrt(second_of_all / mass_of_all) if second_of_all > 0 else 1.0
    made = []
    for link in links:
        mass, com, inertia = to_central(link)
        second, axes = np.linalg.eigh(pseudo_inertia(nearest_physical(mass, np.zeros(3), inertia))[:3, :3])
        least = mass * (THINNEST * size) ** 2
        if mass <= 0:
            mass, com = DUMMY_MASS * mass_of_all or 1.0, np.zeros(3)
            least = mass * (DUMMY_SIZE * size) ** 2
            second = np.zeros(3)
        moments = axes @ np.diag(second.clip(min=least)) @ axes.T
        made.append(from_central(mass, com, np.trace(moments) * np.eye(3) - moments))
    return np.concatenate(made)


def _root(information: Array) -> Array:
    """Matrix R (n_base, rank) with ``information = R R'``."""
    spread = np.sqrt(np.diag(information).clip(min=0.0))
    scale = np.where(spread > 0, spread, 1.0)
    scaled = information / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(scaled)
    if np.abs(scaled - scaled.T).max() > 1e-6 or values[0] < -1e-9 * len(scaled):
        raise InputError("information: not symmetric and positive; give the inverse of the covariance of beta")
    shown = values > 1e-13 * values[-1]
    return spread[:, None] * vectors[:, shown] * np.sqrt(values[shown])


def _flatness(phi: Array) -> float:
    """Least eigenvalue of the links' pseudo-inertias in units of each link's mass and size."""
    pseudo = _pseudo_inertias(phi)
    scale = np.sqrt(np.abs(np.einsum("laa->la", pseudo)))
    scale[:, :3] = np.linalg.norm(scale[:, :3], axis=1, keepdims=True)
    return float(np.linalg.eigvalsh(pseudo / (scale[:, :, None] * scale[:, None, :])).min())


def _pseudo_inertias(phi: Array) -> Array:
    """Pseudo-inertias (J, 4, 4) of all links."""
    return np.tensordot(phi.reshape(-1, 10), _TO_PSEUDO, 1)


def _finite(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = np.asarray(value, float)
    if array.shape != shape or not np.isfinite(array).all():
        raise InputError(f"{name} has shape {array.shape}; give {shape}, all finite numbers")
    return array
