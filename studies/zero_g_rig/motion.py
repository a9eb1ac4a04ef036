"""Joint sequences like the paper's figure 3: one joint after another, some together, each move from rest to rest.

Every joint moves forward and back, at two speeds: on a slow recording at one speed, refitted friction swallows most of
what else is wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RAMP = 3.0
"""[s] In which a joint comes up to speed, or to rest."""


@dataclass(frozen=True)
class Move:
    """Joint number ``joint``, counted from 1, turns by ``change`` [rad] at ``speed`` [rad/s] from ``start`` [s] on."""

    start: float
    joint: int
    change: float
    speed: float

    @property
    def end(self) -> float:
        """When it is at rest again [s]."""
        return self.start + abs(self.change) / self.speed + RAMP


TRAIN = (
    Move(4, 6, 0.25, 0.04),
    Move(5, 2, 0.03, 0.008),
    Move(14, 6, -0.25, 0.02),
    Move(15, 2, -0.03, 0.0045),
    Move(31, 7, 0.60, 0.06),
    Move(44, 5, 0.50, 0.05),
    Move(57, 4, -0.60, 0.06),
    Move(70, 3, 0.40, 0.04),
    Move(83, 1, 0.30, 0.03),
    Move(96, 7, -0.40, 0.02),
    Move(97, 4, 0.30, 0.018),
    Move(119, 5, -0.30, 0.02),
    Move(137, 3, -0.22, 0.016),
    Move(154, 1, -0.16, 0.012),
    Move(171, 3, 0.20, 0.04),
    Move(172, 5, 0.40, 0.05),
    Move(172, 4, -0.50, 0.05),
)
"""The paper's kind of sequence; joints 2 and 6, which lift the arm, move while it is stretched out."""

HOLDOUT = (
    Move(4, 2, -0.025, 0.007),
    Move(4, 6, -0.30, 0.03),
    Move(17, 2, 0.025, 0.004),
    Move(18, 6, 0.30, 0.025),
    Move(33, 1, 0.20, 0.025),
    Move(44, 3, -0.30, 0.035),
    Move(55, 7, -0.50, 0.05),
    Move(67, 4, 0.55, 0.05),
    Move(80, 5, -0.45, 0.045),
    Move(93, 3, 0.25, 0.018),
    Move(110, 7, 0.35, 0.02),
    Move(111, 5, 0.30, 0.02),
    Move(131, 1, -0.18, 0.014),
    Move(147, 4, -0.40, 0.022),
    Move(168, 3, -0.35, 0.035),
    Move(169, 1, 0.15, 0.02),
)
"""Other targets, order and speeds."""

DURATION = 190.0
"""[s] Of either."""


@dataclass(frozen=True)
class JointMoves:
    """Moves as a motion: time [s] (n,) to position and rate, each (n, 7) [rad, rad/s], zero at the start."""

    moves: Sequence[Move]

    def __call__(self, time: Array) -> tuple[Array, Array]:
        """Sum of all moves; rates rise and fall over RAMP with a bounded jerk (raised cosine)."""
        q, qd = np.zeros((2, len(time), 7))
        for m in self.moves:
            cruise = abs(m.change) / m.speed - RAMP
            speed = np.copysign(m.speed, m.change)
            up, down = (np.clip(time - begin, 0.0, RAMP) for begin in (m.start, m.start + RAMP + cruise))
            steady = np.clip(time - m.start - RAMP, 0.0, cruise)
            q[:, m.joint - 1] += speed * (_risen(up) + steady + down - _risen(down))
            qd[:, m.joint - 1] += speed * (_rise(up) - _rise(down))
        return q, qd


def varied(moves: Sequence[Move], rng: np.random.Generator) -> tuple[Move, ...]:
    """The moves with every speed and change up to 15 % smaller, so that no move starts before the last ends.

    A joint's changes shrink alike: what comes back still comes back. On slings that keep their height, a joint 2 or 6
    left at 2 mrad is a twist like the one that is concealed.
    """
    speeds = rng.uniform(0.85, 1.0, len(moves))
    least = {m.joint: min(v for o, v in zip(moves, speeds, strict=True) if o.joint == m.joint) for m in moves}
    changes = {joint: rng.uniform(0.85, v) for joint, v in sorted(least.items())}
    return tuple(
        Move(m.start, m.joint, m.change * changes[m.joint], m.speed * v) for m, v in zip(moves, speeds, strict=True)
    )


def _rise(t: Array) -> Array:
    return (1.0 - np.cos(np.pi * t / RAMP)) / 2


def _risen(t: Array) -> Array:
    return t / 2 - RAMP * np.sin(np.pi * t / RAMP) / (2 * np.pi)
