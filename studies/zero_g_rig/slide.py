"""LuGre friction at the slides' contacts (Canudas de Wit, Olsson, Åström and Lischinsky 1995).

    ż = v − σ0 |v| z / g(v) − z / τ      F = σ0 z + σ1 ż + σ2 v      g(v) = Fc + (Fs − Fc) exp(−(v / vs)²)

v is the sliding speed [m/s], z the bristles' deflection [m]. The last term of ż, with a time τ that may be infinite,
lets the bristles of a hanging slide creep back: a sling never hangs quite still.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Slide:
    """Friction of several contacts; arrays (n_contacts,) or scalars.

    Parameters
    ----------
    coulomb, static : array
        Fc and Fs [N].
    stribeck_speed : array
        vs [m/s].
    viscous : array
        σ2 [N·s/m].
    deflection : float
        Bristles' deflection Fc / σ0 [m].
    creep : float
        τ [s].
    """

    coulomb: Array | float
    static: Array | float
    stribeck_speed: Array | float
    viscous: Array | float
    deflection: float = 2e-7
    creep: float = np.inf

    def steady(self, speed: Array) -> Array:
        """Force at steady sliding speeds [m/s], shape that speed and the contacts broadcast to [N]."""
        level = self._level(speed)
        stiffness = self.coulomb / self.deflection
        rate = stiffness * np.abs(speed) / level + 1.0 / self.creep
        z = np.divide(speed, rate, out=np.zeros(np.broadcast(speed, level).shape), where=rate > 0)
        return stiffness * z + self.viscous * speed

    def step(self, z: Array, speed: Array, period: float) -> tuple[Array, Array]:
        """Bristles after ``period`` [s] at a constant speed, exactly, and the mean force meanwhile [N]."""
        stiffness = self.coulomb / self.deflection
        rate = stiffness * np.abs(speed) / self._level(speed) + 1.0 / self.creep
        exponent = rate * period
        share = np.where(exponent > 1e-9, -np.expm1(-exponent) / np.maximum(exponent, 1e-12), 1.0 - exponent / 2)
        new = z + (speed - rate * z) * period * share
        damping = 2e-3 * stiffness
        force = stiffness * (z + new) / 2 + damping * (new - z) / period + self.viscous * speed
        return new, force

    def _level(self, speed: Array) -> Array:
        return self.coulomb + (self.static - self.coulomb) * np.exp(-((speed / self.stribeck_speed) ** 2))
