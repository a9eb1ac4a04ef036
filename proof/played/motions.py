"""Asked motions in joint space and in task space: arrays (n, J) at `STEP`, from rest to rest."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from .robots import Arm, Dynamics, Rng

STEP = 1e-3  # s
Motion = tuple[NDArray, NDArray, NDArray]
"""q, qd, qdd."""

ROUNDED = 0.02
"""Time over which a controller rounds corners of its set points [s]."""

DAMPING = 0.05
"""Of the inverse kinematics [m]: near singular poses the tip strays, and the joints stay slow."""


def motion(rng: Rng, arm: Arm, duration: float) -> Motion:
    """Two stretches of different make: Fourier sums, moves with stops, or the tip on circles and lines.

    Drawn again where a joint stands throughout: the tip does not feel the last one, and a first move may not fit.
    """
    makers = [(_sums, _stops, _tip)[k] for k in rng.permutation(3)[:2]]
    count = round(duration / STEP)
    cut = int(count * rng.uniform(0.4, 0.6))
    middle = arm.low + (arm.high - arm.low) * rng.uniform(0.35, 0.65, len(arm.joints))
    reach = np.minimum(0.45 * (arm.high - arm.low), rng.uniform(0.5, 1.3, len(arm.joints)))
    pieces = [make(rng, arm, n, middle, reach) for make, n in zip(makers, (cut, count - cut), strict=True)]
    # The second stretch starts where the first ended, and its own way back is faded in.
    q = np.concatenate([pieces[0], pieces[1] + (pieces[0][-1] - pieces[1][0])])
    q = gaussian_filter1d(q, ROUNDED / STEP, axis=0, mode="nearest")
    if (np.ptp(q, axis=0) < 1e-6).any():
        return motion(rng, arm, duration)
    qd = np.gradient(q, STEP, axis=0)
    return q, qd, np.gradient(qd, STEP, axis=0)


def smooth(x: NDArray) -> NDArray:
    """From 0 to 1 with two derivatives that start and end at 0."""
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def _faded(count: int) -> NDArray:
    time = np.arange(count) * STEP
    edge = min(1.0, 0.2 * time[-1])
    return smooth(np.clip(np.minimum(time, time[-1] - time) / edge, 0.0, 1.0))[:, None]


def _calm(q: NDArray, arm: Arm) -> NDArray:
    """Slower where a joint's limit of speed would not hold, by a smaller motion about its start."""
    fastest = np.abs(np.gradient(q, STEP, axis=0)).max(axis=0) + 1e-12
    return q[:1] + (q - q[:1]) * np.minimum(1.0, 0.8 * arm.speed / fastest)


def _sums(rng: Rng, arm: Arm, count: int, middle: NDArray, reach: NDArray) -> NDArray:
    time = np.arange(count)[:, None] * STEP
    base = rng.uniform(0.08, 0.2)
    q = np.zeros((count, len(reach)))
    for k in range(1, int(rng.integers(3, 7)) + 1):
        phase = rng.uniform(0.0, 2.0 * np.pi, len(reach))
        q += rng.uniform(0.3, 1.0, len(reach)) / k * np.sin(2.0 * np.pi * base * k * time + phase)
    q *= _faded(count) * reach / np.abs(q).max(axis=0)
    return _calm(middle + q, arm)


def _stops(rng: Rng, arm: Arm, count: int, middle: NDArray, reach: NDArray) -> NDArray:
    """All joints start a move together and arrive together, as an industrial controller drives them."""
    q = np.tile(middle, (count, 1))
    now, here = int(0.3 / STEP), middle
    while True:
        goal = middle + reach * rng.uniform(-1.0, 1.0, len(reach))
        # The steepest slope of the smooth step is 15/8.
        needed = 1.875 * np.abs(goal - here) / (0.8 * arm.speed * rng.uniform(0.2, 1.0))
        steps = int(max(float(needed.max()), 0.5) / STEP)
        if now + steps >= count:
            return q
        q[now : now + steps] = here + (goal - here) * smooth(np.arange(steps) / steps)[:, None]
        q[now + steps :] = goal
        now, here = now + steps + int(rng.uniform(0.05, 0.6) / STEP), goal


def _tip(rng: Rng, arm: Arm, count: int, middle: NDArray, reach: NDArray) -> NDArray:
    """The tip on an ellipse, then along lines between points of it; damped least squares follow it."""
    body = Dynamics(arm)
    place, _ = body.tip(middle)
    size = rng.uniform(0.08, 0.2) * max(float(np.linalg.norm(place)), 0.3)
    one, other = np.linalg.qr(rng.normal(size=(3, 2)))[0].T * size * np.array([[1.0], [rng.uniform(0.4, 1.0)]])
    time = np.arange(count) * STEP
    turn = 2.0 * np.pi * rng.uniform(0.12, 0.35) * time
    away = _faded(count) * (np.sin(turn)[:, None] * one + np.sin(turn * rng.choice([1.0, 2.0]) + 1.0)[:, None] * other)
    every = 10
    q = middle.copy()
    rows = [q]
    for goal in place + away[every::every]:
        at, jacobian = body.tip(q)
        pull = np.linalg.solve(jacobian @ jacobian.T + DAMPING**2 * np.eye(3), goal - at)
        q = q + np.clip(jacobian.T @ pull, -0.8 * every * STEP * arm.speed, 0.8 * every * STEP * arm.speed)
        rows.append(q)
    coarse = np.array(rows)
    knots = np.arange(len(coarse)) * every * STEP

    found = CubicSpline(knots, gaussian_filter1d(coarse, 12.0, axis=0, mode="nearest"))(np.minimum(time, knots[-1]))
    return _calm(np.asarray(found), arm)
