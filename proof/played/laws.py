"""What a drive costs along a motion, in other forms than the tool's: Maxwell's slip, tables, powers, quotients."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .motions import STEP
from .robots import Rng

ELEMENTS = 4


@dataclass(frozen=True, eq=False)
class Slip:
    """Maxwell-slip friction (Lampaert, Swevers and Al-Bender 2003): springs that slide at their travels [rad]."""

    travels: tuple[float, ...]
    shares: tuple[float, ...]

    @staticmethod
    def draw(rng: Rng, travel: float) -> "Slip":
        """Elements that slide within a small part of a joint's travel [rad]."""
        size = travel * float(np.exp(rng.uniform(np.log(2e-4), np.log(1.5e-3))))
        return Slip(tuple(size * np.arange(1, ELEMENTS + 1) / 2.0), tuple(rng.dirichlet(np.full(ELEMENTS, 3.0))))

    def along(self, q: NDArray) -> NDArray:
        """Direction of motion (n,), between -1 and 1, which turns round over the elements' travels."""
        found = np.zeros(len(q))
        for travel, share in zip(self.travels, self.shares, strict=True):
            bent, out = 0.0, np.empty(len(q))
            for k, step in enumerate(np.diff(q, prepend=q[:1]).tolist()):
                bent = min(max(bent + step / travel, -1.0), 1.0)
                out[k] = bent
            found += share * out
        return found


def dip(qd: NDArray, speed: float) -> NDArray:
    """A fall of friction with speed as a quotient, not an exponential (Hess and Soom 1990)."""
    return 1.0 / (1.0 + (qd / speed) ** 2)


def table(x: NDArray, period: float, knots: NDArray) -> NDArray:
    """A table over a coordinate that repeats, straight between its knots: a gear's teeth, a shaft that is bent."""
    n = len(knots)
    at = (x / period % 1.0) * n
    low = np.floor(at).astype(int) % n
    return knots[low] + (at - np.floor(at)) * (knots[(low + 1) % n] - knots[low])


def zero_mean(rng: Rng, n: int) -> NDArray:
    """Knots without a level."""
    x = rng.normal(size=n)
    return x - x.mean()


def hardening(q: NDArray, share: float) -> NDArray:
    """A cable that gets stiffer as it is bent; straight for a share of 0."""
    return q + share * q**3


def late(x: NDArray, delay: float) -> NDArray:
    """A signal (n,) at `STEP`, a delay [s] later."""
    time = np.arange(len(x)) * STEP
    return np.interp(time - delay, time, x)


def warmth(power: NDArray, time: float) -> NDArray:
    """How warm a joint is (n,), 1 where the mean power holds it: heat comes with power, and leaves with a time [s]."""
    keep = float(np.exp(-STEP / time))
    out, now = np.empty(len(power)), 0.0
    mean = float(np.mean(power)) + 1e-12
    for k, p in enumerate((power / mean).tolist()):
        now = keep * now + (1.0 - keep) * p
        out[k] = now
    return out
