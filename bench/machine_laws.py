"""What machines do beside rigid bodies, as textbooks on gears, motors and heat write it: laws without a plant.

None is written as the tool's vocabulary has it: a recording that proves a diagnosis does not come from the model that
explains it. T is N·m, S is rad.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


def gear_loss(load: ArrayLike, qd: ArrayLike, driving: float, braking: float, scale: float) -> NDArray:
    """Torque [T] that a gear takes: a share of the transmitted power P = load · qd, over the speed.

    The share runs from ``braking`` to ``driving`` as P goes from negative to positive, over a power ``scale`` [W] by
    tanh, and the loss is zero at rest. Far from zero power it is share · \\|load\\| against the motion.
    """
    side = np.tanh(np.asarray(load) * qd / scale)
    return side * load * (braking + (driving - braking) * (1.0 + side) / 2.0)


def froehlich(asked: ArrayLike, knee: float) -> NDArray:
    """Torque [T] of a motor whose flux falls as Fröhlich (1881) has it: asked / (1 + \\|asked\\| / knee).

    ``asked`` is current times the torque constant at small current; ``knee`` is where half of it is left.
    """
    return np.asarray(asked) / (1.0 + np.abs(asked) / knee)


def froehlich_asked(given: ArrayLike, knee: float) -> NDArray:
    """What must be asked for a torque below ``knee``: the inverse of `froehlich`."""
    return np.asarray(given) / (1.0 - np.abs(given) / knee)


def tanh_motor(asked: ArrayLike, knee: float) -> NDArray:
    """Torque [T] of a motor whose iron saturates by a tanh: knee · tanh(asked / knee)."""
    return knee * np.tanh(np.asarray(asked) / knee)


def tanh_asked(given: ArrayLike, knee: float) -> NDArray:
    """The inverse of `tanh_motor`."""
    return knee * np.arctanh(np.asarray(given) / knee)


@dataclass(frozen=True)
class Grease:
    """A joint whose friction falls with its temperature, a body of one heat capacity that its own friction warms.

    ``capacity`` · θ' = friction power − ``capacity`` / ``time`` · θ, θ [K] above the surroundings (Newton 1701); of the
    cold friction a share ``most`` · (1 − exp(−θ / ``span``)) is lost (Bittencourt et al. 2010: towards a least level).
    Units: J/K, s, 1, K.
    """

    capacity: float
    time: float
    most: float
    span: float

    def lost(self, theta: ArrayLike) -> NDArray:
        """Share of the cold friction that is gone."""
        return -self.most * np.expm1(-np.asarray(theta) / self.span)

    def warmed(self, theta: float, power: float, step: float) -> float:
        """Temperature above the surroundings [K] a ``step`` [s] later at constant ``power`` [W], exact."""
        held = power * self.time / self.capacity
        return held + (theta - held) * float(np.exp(-step / self.time))


def slots(q: ArrayLike, pitch: float, rise: float) -> NDArray:
    """Cogging of a slotted motor, 2 from peak to peak, mean zero: a table over the ``pitch`` [S] of its slots.

    It climbs over a share ``rise`` of the pitch, stays for a tenth, falls, and stays for a tenth.
    """
    turns = [0.0, rise, rise + 0.1, 0.9, 1.0]
    table = np.array([-1.0, 1.0, 1.0, -1.0, -1.0])
    return np.interp(np.asarray(q) / pitch % 1.0, turns, table) - np.trapezoid(table, turns)
