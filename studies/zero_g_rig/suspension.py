"""Slings from force-controlled winches on carriages that follow, and what can be wrong with them.

For a hang point p (3,), its height z above the start and its carriage c (2,):

    winch        d ẇ = T0 (1 + ε) − T − h w         (d: residual drag, h: height stiffness; both zero when ideal)
    sling        T = T0 + k (w − z),  T ≥ 0
    carriage     c̈ = (2 ζ / lag)² (p − c) − 2 ζ (2 ζ / lag) ċ
    play         the pin sits anywhere within a radius of the hole's centre and is dragged by its rim
    force        T (c − p − s, length) / |...| acts at p + s, s being the pin's place in the hole
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ZETA = 0.8


@dataclass(frozen=True, eq=False)
class Suspension:
    """All slings; arrays (n_units,) or scalars.

    Parameters
    ----------
    length : float
        Sling, from carriage to hang point [m].
    stiffness : float
        k [N/m]: 2e5 is a steel rope of 4 mm, 10 m long.
    drag : float
        d [N·s/m].
    height_stiffness : array
        h [N/m].
    error : array
        ε, relative.
    lag : array
        Of the carriage behind a hang point in steady motion [s].
    play : array
        Radius [m].
    """

    length: float = 10.0
    stiffness: float = 2e5
    drag: float = 1.0
    height_stiffness: Array | float = 0.0
    error: Array | float = 0.0
    lag: Array | float = 1e-4
    play: Array | float = 0.0


class Slings:
    """A suspension in motion: winches, carriages and pins; starts hanging straight at points (n_units, 3)."""

    def __init__(self, suspension: Suspension, weight: Array, points: Array) -> None:
        """Hang the arm up; weight (n_units,) [N] is each unit's share."""
        n = len(weight)
        self._s, self._weight = suspension, weight
        self._height = points[:, 2].copy()
        self._last = points[:, :2].copy()
        self._winch = weight * suspension.error / (suspension.stiffness + suspension.height_stiffness) * np.ones(n)
        self.carriage, self._speed = points[:, :2].copy(), np.zeros((n, 2))
        self.pin = np.zeros((n, 2))
        self._play = np.broadcast_to(np.asarray(suspension.play, float), (n,))
        self._bandwidth = (2 * ZETA / np.broadcast_to(np.asarray(suspension.lag, float), (n,)))[:, None]
        self.tension = weight * (1.0 + suspension.error)

    def step(self, points: Array, period: float) -> tuple[Array, Array]:
        """Force on each unit (n_units, 3) [N] and where it acts, from the hang points at mid-step."""
        s = self._s
        rise = points[:, 2] - self._height
        pull = self._weight * s.error + s.stiffness * rise + s.drag * self._winch / period
        self._winch = pull / (s.drag / period + s.stiffness + s.height_stiffness)
        self.tension = np.maximum(self._weight + s.stiffness * (self._winch - rise), 0.0)
        if self._play.any():
            self.pin -= points[:, :2] - self._last
            radius = np.sqrt((self.pin**2).sum(1))
            self.pin *= np.minimum(1.0, self._play / np.maximum(radius, 1e-12))[:, None]
        self._last = points[:, :2].copy()
        acting = points.copy()
        acting[:, :2] += self.pin
        apart = acting[:, :2] - self.carriage
        w = self._bandwidth
        # Implicit Euler: a fast carriage must not set the step.
        self._speed = (self._speed + period * w**2 * apart) / (1.0 + 2 * ZETA * w * period + (w * period) ** 2)
        self.carriage = self.carriage + period * self._speed
        force = np.empty_like(points)
        lean = (self.carriage - acting[:, :2]) / s.length
        force[:, 2] = self.tension / np.sqrt(1.0 + (lean**2).sum(1))
        force[:, :2] = force[:, 2:] * lean
        return force, acting
