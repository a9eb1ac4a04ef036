"""A ring that turns as it is told; each new rate is reached over a ramp u²(3 − 2u), as in `drive.ring_motion`."""

from dataclasses import dataclass

import numpy as np


@dataclass
class CommandedRing:
    """Angle and rate of the ring at a time, for `SnareModel`'s drive.

    Parameters
    ----------
    ramp : float
        In which a new rate is reached [s].
    state : tuple of four floats
        Since when [s], the angle then [rad], the rate then and the rate wanted [rad/s].
    """

    ramp: float
    state: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def command(self, time: float, rate: float) -> None:
        """From a time [s] on turn at a rate [rad/s]."""
        if rate != self.state[3]:
            self.state = (time, *self(time), rate)

    def __call__(self, time: float) -> tuple[float, float]:
        """Angle [rad] and rate [rad/s]."""
        since, angle, first, last = self.state
        passed = max(time - since, 0.0)
        u = min(passed / self.ramp, 1.0)
        shape = self.ramp * (u**3 - 0.5 * u**4) + max(passed - self.ramp, 0.0)
        return angle + first * passed + (last - first) * shape, first + (last - first) * u * u * (3 - 2 * u)


def ring_torque(ends: np.ndarray, points: np.ndarray, frame: np.ndarray) -> float:
    """Torque of the cables on the rotating ring about the end effector's axis [N·m].

    Parameters
    ----------
    ends, points : array (6, 3)
        Forces of the cables on the rings [N], and where; fixed and rotating ring in turn.
    frame : array (6, 3)
        The end effector's.
    """
    arms = points[1::2] - frame[0]
    return float(np.cross(arms, ends[1::2]).sum(axis=0) @ frame[3:, 0])
