"""Motions to excite an arm with: functions of time [s] (n_samples,) that give q, qd, qdd (n_samples, n_joints)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arm import Arm

Motion = Callable[[NDArray], tuple[NDArray, NDArray, NDArray]]


def fourier_motion(
    arm: Arm,
    rng: np.random.Generator,
    duration: float,
    *,
    terms: int = 5,
    highest: float = 0.6,
    share: float = 0.8,
    ramp: float = 1.5,
) -> Motion:
    """Sines up to ``highest`` [Hz] that fade in and out over ``ramp`` [s], scaled to ``share`` of the arm's limits."""
    ramp = min(ramp, duration / 2.0)
    n = len(arm.links)
    omega = 2.0 * np.pi * rng.uniform(0.05, highest, (terms, n))
    phase = rng.uniform(0.0, 2.0 * np.pi, (terms, n))
    size = rng.uniform(0.5, 1.0, (terms, n)) / omega

    def raw(time: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        angle = omega * time[:, None, None] + phase
        x, xd, xdd = (
            np.sum(size * f, axis=1) for f in (np.sin(angle), omega * np.cos(angle), -(omega**2) * np.sin(angle))
        )
        w, wd, wdd = (f[:, None] for f in _fade(time, duration, ramp))
        return w * x, wd * x + w * xd, wdd * x + 2.0 * wd * xd + w * xdd

    q, qd, _ = raw(np.linspace(0.0, duration, 4000))
    travel, speed = (np.array([getattr(link, name) for link in arm.links]) for name in ("travel", "speed"))
    scale = share * np.minimum(travel / np.abs(q).max(axis=0), speed / np.abs(qd).max(axis=0))

    def scaled(time: ArrayLike) -> tuple[NDArray, NDArray, NDArray]:
        q, qd, qdd = raw(np.asarray(time, float))
        return scale * q, scale * qd, scale * qdd

    return scaled


def point_to_point_motion(
    arm: Arm,
    rng: np.random.Generator,
    duration: float,
    *,
    slowest: float = 0.1,
    share: float = 0.8,
    dwell: float = 0.3,
) -> Motion:
    """Moves from rest to rest with a cruise between two blends, all joints together, each move at a speed of its own.

    The fastest joint of a move cruises at a random part, from ``slowest`` to ``share``, of its speed limit. The first
    and last poses are zero; blends last 0.3 s and have a bounded jerk (raised-cosine acceleration).
    """
    blend = 0.3
    travel, speed = (np.array([getattr(link, name) for link in arm.links]) for name in ("travel", "speed"))
    here, start = np.zeros(len(travel)), 0.0
    moves: list[tuple[float, float, NDArray, NDArray]] = []

    def cruise_time(change: NDArray, part: float) -> float:
        return max(float(np.max(np.abs(change) / (part * speed))) - blend, 0.05)

    while True:
        target = share * travel * rng.uniform(-1.0, 1.0, len(travel))
        cruise = cruise_time(target - here, rng.uniform(slowest, share))
        home = cruise_time(target, share) + 2.0 * blend
        if start + cruise + 2.0 * blend + dwell + home > duration:
            break
        moves.append((start, cruise, here, target))
        start, here = start + cruise + 2.0 * blend + dwell, target
    if not moves:
        raise ValueError(f"duration {duration} s is too short for a move and the way back; try another seed or longer")
    moves.append((start, duration - start - 2.0 * blend, here, np.zeros(len(travel))))

    def motion(time: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        time = np.asarray(time, float)
        q, qd, qdd = np.zeros((3, len(time), len(travel)))
        for begin, cruise, a, b in moves:
            s, sd, sdd = _cruise_profile(time - begin, blend, cruise)
            q += s[:, None] * (b - a)
            qd += sd[:, None] * (b - a)
            qdd += sdd[:, None] * (b - a)
        return q, qd, qdd

    return motion


def _fade(time: NDArray, duration: float, ramp: float) -> tuple[NDArray, NDArray, NDArray]:
    """Quintic window from 0 up to 1 and back with two continuous derivatives."""
    up = np.minimum(time, duration - time) / ramp
    sign = np.where(time < duration - time, 1.0, -1.0) / ramp
    inside = (up > 0.0) & (up < 1.0)
    s = np.clip(up, 0.0, 1.0)
    value = s**3 * (10.0 + s * (6.0 * s - 15.0))
    slope = 30.0 * s**2 * (1.0 - s) ** 2 * inside
    curve = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) * inside
    return value, sign * slope, curve / ramp**2


def _cruise_profile(time: NDArray, blend: float, cruise: float) -> tuple[NDArray, NDArray, NDArray]:
    """From 0 to 1 in ``2 * blend + cruise`` [s]."""
    top = 1.0 / (blend + cruise)
    total = 2.0 * blend + cruise

    def rise(t: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        turn = 2.0 * np.pi * t / blend
        return (
            top * (t**2 / (2.0 * blend) + blend / (4.0 * np.pi**2) * (np.cos(turn) - 1.0)),
            top * (t / blend - np.sin(turn) / (2.0 * np.pi)),
            top / blend * (1.0 - np.cos(turn)),
        )

    first, last = rise(np.clip(time, 0.0, blend)), rise(np.clip(total - time, 0.0, blend))
    middle = top * np.clip(time - blend, 0.0, cruise)
    s = first[0] + middle + top * blend / 2.0 - last[0]
    sd = np.where(time < blend, first[1], np.where(time < total - blend, top, last[1]))
    sdd = first[2] - last[2]
    return s, sd, sdd
