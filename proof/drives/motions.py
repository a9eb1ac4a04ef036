"""Asked motions at the servo's ticks, and torques that push: arrays (n_ticks, n_joints)."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfilt

from .loop import TICK
from .robots import Rng

STILL = 1.0
"""Rest before a recording starts [s]."""

SHARE = 0.9
WHITE, COLOURED, WANDERING = "white", "coloured", "wandering"
KINDS = (WHITE, COLOURED, WANDERING)


def motion(rng: Rng, duration: float, travel: NDArray, speed: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Two stretches of different make, each from rest to rest at the middle: q, qd, qdd (n_ticks, n), with `STILL`."""
    parts = rng.permutation(3)[:2]
    ticks = round(duration / TICK) + 1
    cut = int(ticks * rng.uniform(0.4, 0.6))
    makers = (_sums, _stops, _chirps)
    rest = np.zeros((round(STILL / TICK), len(travel)))
    pieces = [
        makers[p](rng, count, SHARE * travel, SHARE * speed) for p, count in zip(parts, (cut, ticks - cut), strict=True)
    ]
    q = np.concatenate([rest, *pieces])
    qd = np.gradient(q, TICK, axis=0)
    return q, qd, np.gradient(qd, TICK, axis=0)


def _faded(count: int) -> NDArray:
    """1 but for a rise and a fall of 1.5 s or a quarter, each with a smooth third derivative, as a column."""
    edge = min(1.5, 0.25 * count * TICK)
    time = TICK * np.arange(count)
    x = np.clip(np.minimum(time, time[-1] - time) / edge, 0.0, 1.0)
    return _smooth(x)[:, None]


def _smooth(x: NDArray) -> NDArray:
    return x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)


def _within(q: NDArray, travel: NDArray, speed: NDArray) -> NDArray:
    """Scaled to limits of position and speed, a joint at a time."""
    return q * np.minimum(travel / np.abs(q).max(axis=0), speed / np.abs(np.gradient(q, TICK, axis=0)).max(axis=0))


def _sums(rng: Rng, count: int, travel: NDArray, speed: NDArray) -> NDArray:
    """Fourier sums (Swevers et al. 1997) of a common lowest frequency."""
    time = TICK * np.arange(count)[:, None]
    base, waves = float(rng.uniform(0.07, 0.15)), int(rng.integers(4, 8))
    q = np.zeros((count, len(travel)))
    for k in range(1, waves + 1):
        size = rng.uniform(0.3, 1.0, len(travel)) / k
        q += size * np.sin(2.0 * np.pi * base * k * time + rng.uniform(0.0, 2.0 * np.pi, len(travel)))
    return _within(_faded(count) * q, travel, speed)


def _stops(rng: Rng, count: int, travel: NDArray, speed: NDArray) -> NDArray:
    """From point to point with stops, every joint at its own time of moves; some moves slow."""
    q = np.zeros((count, len(travel)))
    for j in range(len(travel)):
        now, here = 0, 0.0
        while True:
            goal = float(rng.uniform(-1.0, 1.0)) * travel[j]
            pace = speed[j] * float(np.exp(rng.uniform(np.log(0.15), 0.0)))
            # The steepest slope of the smooth step is 2.19.
            steps = int(max(2.19 * abs(goal - here) / pace, 0.4) / TICK)
            back = int(max(2.19 * abs(goal) / speed[j], 0.4) / TICK)
            dwell = int(rng.uniform(0.1, 0.8) / TICK)
            if now + steps + dwell + back >= count:
                break
            q[now : now + steps, j] = here + (goal - here) * _smooth(np.arange(steps) / steps)
            q[now + steps : now + steps + dwell, j] = goal
            now, here = now + steps + dwell, goal
        back = int(max(2.19 * abs(here) / speed[j], 0.4) / TICK)
        q[now : now + back, j] = here * (1.0 - _smooth(np.arange(back) / back))
    return q


def _chirps(rng: Rng, count: int, travel: NDArray, speed: NDArray) -> NDArray:
    """Sweeps whose amplitude falls as frequency grows."""
    time = TICK * np.arange(count)[:, None]
    low, high = rng.uniform(0.05, 0.12, len(travel)), rng.uniform(0.6, 1.4, len(travel))
    frequency = low + (high - low) * time / time[-1]
    phase = 2.0 * np.pi * (low * time + 0.5 * (high - low) * time**2 / time[-1])
    sizes = np.minimum(travel, speed / (2.0 * np.pi * frequency))
    return _within(_faded(count) * sizes * np.sin(phase + rng.uniform(0.0, 2.0 * np.pi, len(travel))), travel, speed)


def disturbance(rng: Rng, kind: str, scale: float, count: int, n: int) -> NDArray:
    """Torque of RMS 1 that nothing measures, independent for each joint (n_ticks, n).

    ``scale``: white up to this frequency [Hz]; the memory of a coloured one [s]; that of a wandering one [s], infinite
    for a random walk. The level that a wandering one has on average is a bias, and is taken off.
    """
    shocks = rng.standard_normal((count, n))
    if kind == WHITE:
        made = sosfilt(butter(4, scale, fs=1.0 / TICK, output="sos"), shocks, axis=0)
        return made / np.sqrt(2.0 * scale * TICK)
    keep = float(np.exp(-TICK / scale)) if np.isfinite(scale) else 1.0
    # In its steady state from the first tick on; a random walk starts at zero.
    fresh, start = (np.sqrt(1.0 - keep**2), rng.standard_normal((1, n))) if keep < 1.0 else (1.0, np.zeros((1, n)))
    made, _ = lfilter([fresh], [1.0, -keep], shocks, axis=0, zi=keep * start)
    if kind == WANDERING:
        made -= made.mean(axis=0)
        made /= np.sqrt(np.mean(made**2, axis=0))
    return made


def scale(rng: Rng, kind: str) -> float:
    """Draw the second number of `disturbance`."""
    if kind == WHITE:
        return float(rng.uniform(15.0, 40.0))
    if kind == COLOURED:
        return float(np.exp(rng.uniform(np.log(0.05), np.log(0.5))))
    return float(rng.choice([np.inf, rng.uniform(3.0, 10.0)]))
