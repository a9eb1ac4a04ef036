"""Evidence of a reading of the data under the model, by a joint weighted least-squares fit.

Torque of channel c is the rigid body's, tau0, plus columns for all that a sound machine may have besides, each with a
prior that says how much of it there can be: ``y = tau0 + X b + e``, b between bounds and N(0, width²). Masses, centres
and inertias are felt on every channel, so that all channels are fitted at once. The noise of each channel is not known;
with n_c independent samples its evidence is, but for constants of the data,

    log p(y) = - sum_c n_c / 2 * log(e_c' e_c / y_c' y_c + FLOOR²) - 1/2 sum_k (b_k / width_k)²,

at its maximum over b, which reweighting finds. Residuals count relative to the channel, so that readings that scale it
are compared on the same data.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...models.inertia import to_central
from ...models.rigid_body import RigidBody
from ...models.tree import Tree
from .bounded import least_above
from .reading import Reading, Samples

Array = NDArray[np.float64]
Index = NDArray[np.int_]

FLOOR = 0.015
"""Relative residual below which nothing is told: models of sound arms leave that much."""

ROUNDS = 4
"""Reweightings; the channels' noise settles within them."""

WAYS = 7
"""Ways in which a joint with its sensors may differ from the robot's file."""

AROUND = np.array([x for x in product((-1.0, 0.0, 1.0), repeat=3) if sum(map(abs, x)) in (1.0, 3.0)])
"""Directions (14, 3) in which a load may stand beside a link: they span every position and product of inertia."""

GAIN = 0.2
"""One standard deviation of a torque channel's gain; it is the last of a joint's ways."""

STILL = 0.02
"""Share of a joint's largest speed below which its direction is not known, and friction bends."""


@dataclass(frozen=True, eq=False)
class ReadingFit:
    """A reading's fit.

    ``value`` is its log evidence, ``relative`` (c,) each channel's residual over its torque, ``prior`` the price of the
    parameters in nats, ``residual`` (n, c) relative to the channel's RMS.
    """

    value: float
    relative: Array
    prior: float
    residual: Array
    parameters: Array


class CheckBasis:
    """Samples, rigid body and priors with which all readings are compared.

    Parameters
    ----------
    body : RigidBody
    samples : Samples
    free : bool
        Whether inertial parameters are identified, so that the URDF's are little more than a guess.
    counted : array (J,)
        Independent samples of each channel; 0 leaves a channel out.
    """

    def __init__(self, body: RigidBody, samples: Samples, free: bool, counted: Array) -> None:
        """Work out once what links may differ by."""
        self.body, self.samples, self.counted = body, samples, counted
        self.spread, self.least, self.ways = _inertial_directions(body.tree, 3.0 if free else 1.0)

    def fit(
        self,
        reading: Reading,
        columns: tuple[Array, Array, Array] | None = None,
        bounded: bool = True,
        without: NDArray[np.bool_] | None = None,
    ) -> ReadingFit:
        """Evidence of a reading.

        ``columns`` (n, J, k), with widths and lower bounds (k,), are added to the usual ones; samples ``without`` (n,
        J) do not count in the fit, but are part of its residual.
        """
        samples = self.samples.under(reading)
        y, design, low = self._design(samples, reading.gravity, columns)
        # A channel brings its independent samples along where another reading gives it to another joint.
        counted = self.counted[reading.torque_source]
        used = counted > 0
        size = np.sqrt(np.mean(samples.tau**2, axis=0)) + 1e-300
        y, design = (y / size)[:, used], [(at, x / size[c]) for c, (at, x) in enumerate(design) if used[c]]
        counted, n = counted[used], len(y)
        scale = np.sum((samples.tau / size)[:, used] ** 2, axis=0)
        kept = np.ones_like(y) if without is None else 1.0 - without[:, used]
        told = [x * kept[:, [c]] for c, (_, x) in enumerate(design)]
        products = [(at, x.T @ x, x.T @ y[:, c]) for c, ((at, _), x) in enumerate(zip(design, told, strict=True))]
        weights, b, residual = counted / (np.sum(y**2, axis=0) + FLOOR**2 * scale), np.zeros(len(low)), y
        held = np.zeros(len(low), bool)
        for _ in range(ROUNDS if bounded else 2):
            matrix, right = np.eye(len(b)), np.zeros(len(b))
            for weight, (at, gram, along) in zip(weights, products, strict=True):
                matrix[np.ix_(at, at)] += weight * gram
                right[at] += weight * along
            if bounded:
                b, held = least_above(matrix, right, low, held)
            else:
                b = np.asarray(np.linalg.solve(matrix, right), float)
            residual = y - np.stack([x @ b[at] for at, x in design], 1)
            weights = counted / (np.sum((residual * kept) ** 2, axis=0) + FLOOR**2 * scale)
        share = np.sum((residual * kept) ** 2, axis=0) / scale
        prior = 0.5 * float(b @ b)
        value = -0.5 * float(counted @ np.log(share + FLOOR**2)) - prior - 0.5 * reading.free * np.log(max(n, 2))
        relative = np.full(len(used), np.nan)
        relative[used] = np.sqrt(share)
        whole = np.zeros((n, len(used)))
        whole[:, used] = residual
        return ReadingFit(float(value), relative, prior, whole, b)

    def _design(
        self, samples: Samples, gravity: Array | None, columns: tuple[Array, Array, Array] | None
    ) -> tuple[Array, list[tuple[Index, Array]], Array]:
        """Torque less the rigid body's (n, J), of each channel the columns that reach it, by positions among all P
        and in units of their widths, and lower bounds (P,)."""
        q, tree = samples.q, self.body.tree
        regressor = self.body.packed_regressor(q, samples.qd, samples.qdd, gravity)
        felt = [regressor.of(c) for c in range(tree.n_joints)]
        own = np.stack([x @ tree.phi[at] for at, x in felt], 1)
        joints, lows = _joint_columns(samples, own, self.body.mass_matrix(q[:1])[0].diagonal())
        low, first = [self.least, lows], len(self.least)
        last = first + len(lows)
        found = []
        for c, (at, x) in enumerate(felt):
            ways = np.concatenate([self.ways[k] for k in np.flatnonzero(tree.moves[c])])
            index, parts = [ways, first + WAYS * c + np.arange(WAYS)], [x @ self.spread[np.ix_(at, ways)], joints[c]]
            if columns is not None:
                extra, widths, _ = columns
                here = np.flatnonzero(extra[:, c].any(axis=0))
                index.append(last + here)
                parts.append(extra[:, c, here] * widths[here])
            found.append((np.concatenate(index), np.concatenate(parts, axis=1)))
        if columns is not None:
            low.append(columns[2] / columns[1])
        return samples.tau - own, found, np.concatenate(low)


def _inertial_directions(tree: Tree, wide: float) -> tuple[Array, Array, list[Index]]:
    """How links may differ from the robot's file (10 L, k), one standard deviation each, lower bounds (k,), and which
    of these ways each link has.

    Of each link: mass and all that goes with it by 30 %; loads of 10 % of the whole robot's mass, at its centre and as
    far out again; its centre along three axes by 6 % of its size, and 1 % of the whole robot's mass as far; its own
    inertia by half. What is held stands beside the last link of a branch: loads as heavy about its centre, along the
    axes and the diagonals by its size. ``wide`` times that where the model file says that inertia is free.
    """
    whole = sum(float(link.phi[0]) for link in tree.links)
    reach = max((float(np.linalg.norm(joint.translation)) for joint, *_ in tree.bodies), default=0.0)
    last: NDArray[np.bool_] = np.any(tree.moves[np.sum(tree.moves, axis=1) == 1], axis=0)
    columns, low, ways = [], [], []
    for k, link in enumerate(tree.links):
        mass, com, inertia = to_central(link.phi)
        extent = np.sqrt(max(float(np.trace(inertia)), 0.0) / (2 * mass)) if mass > 0 else 0.0
        size = extent + float(np.linalg.norm(com)) + 0.3 * reach
        steps = [(0.3 * link.phi, -3.0)]
        load = 0.1 * whole
        for point in (com, 2.0 * com, *(com + size * AROUND if last[k] else ())):
            about = load * (point @ point * np.eye(3) - np.outer(point, point))
            steps.append((np.concatenate([[load], load * point, about[np.triu_indices(3)]]), 0.0))
        for axis in np.eye(3):
            moved = (0.06 * mass + 0.01 * whole) * size * axis
            change = com @ moved * 2 * np.eye(3) - np.outer(com, moved) - np.outer(moved, com)
            steps.append((np.concatenate([[0.0], moved, change[np.triu_indices(3)]]), -np.inf))
        steps.append((np.concatenate([np.zeros(4), 0.5 * inertia[np.triu_indices(3)]]), -2.0))
        ways.append(np.arange(len(low), len(low) + len(steps)))
        for step, bound in steps:
            column = np.zeros(10 * len(tree.links))
            column[10 * k : 10 * k + 10] = wide * step
            columns.append(column)
            low.append(bound / wide)
    return np.stack(columns, 1), np.array(low), ways


def _joint_columns(samples: Samples, own: Array, inertia: Array) -> tuple[list[Array], Array]:
    """What joints and sensors of a sound machine may add (n, 7) each, one standard deviation each; lower bounds
    (7 J,).

    Viscous, Coulomb and load-dependent friction (not negative), a rotor's inertia (neither), a spring, a bias, a gain.
    Behind a gear a rotor is often all the inertia that a light joint feels, so that it may be all of the torque.
    """
    n, n_joints = own.shape
    rms = np.sqrt(np.mean(samples.tau**2, axis=0)) + 1e-300
    every = []
    for j in range(n_joints):
        qd, size = samples.qd[:, j], rms[j]
        fast = np.sqrt(np.mean(qd**2)) + 1e-300
        sign = np.tanh(qd / (STILL * np.abs(qd).max() + 1e-300))
        place = samples.q[:, j] - np.mean(samples.q[:, j])
        load = own[:, j] * min(1.0, size / (np.sqrt(np.mean(own[:, j] ** 2)) + 1e-300))
        columns = [
            (qd / fast * size, 0.0),
            (sign * size, 0.0),
            (np.abs(load) * sign * 0.3, 0.0),
            (
                samples.qdd[:, j] * max(2.0 * inertia[j], size / (np.sqrt(np.mean(samples.qdd[:, j] ** 2)) + 1e-300)),
                0.0,
            ),
            (place / (np.sqrt(np.mean(place**2)) + 1e-300) * 0.3 * size, -np.inf),
            (np.full(n, 0.3 * size), -np.inf),
            (own[:, j] * GAIN, -2.5),
        ]
        every.append(columns)
    low = np.array([bound for columns in every for _, bound in columns])
    return [np.stack([values for values, _ in columns], 1) for columns in every], low
