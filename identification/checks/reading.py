"""A reading of the recordings: what their columns may mean, other than what the model file says."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class Reading:
    """Position ``factor * q[source] + offset``, torque ``torque_factor * tau[torque_source]``, time by a factor.

    Parameters
    ----------
    name : str
        Kind of the check.
    at : tuple of str
        Channels it changes; each becomes a finding.
    message : str
        What the columns then are.
    mends : tuple of str
        A line for the model file for each of ``at``.
    factor, offset, torque_factor : array (J,)
    source, torque_source : array (J,) of int
        Whose column each joint's is.
    time : float
        Seconds per second of the recording.
    gravity : array (3,) or None
        [m/s²]; None: the model's.
    free : int
        Numbers in it that were fitted, which evidence counts against it.
    rarer : float
        Log of how much rarer it is than the other readings of its kind.
    """

    name: str
    at: tuple[str, ...]
    message: str
    mends: tuple[str, ...]
    factor: Array
    offset: Array
    torque_factor: Array
    source: Index
    torque_source: Index
    time: float = 1.0
    gravity: Array | None = None
    free: int = 0
    rarer: float = 0.0

    def but(self, **changes: object) -> "Reading":
        """The reading with something changed."""
        return replace(self, **changes)  # type: ignore[arg-type]  a mapping of names says no types


def as_read(n_joints: int) -> Reading:
    """The reading that the model file has."""
    one, own = np.ones(n_joints), np.arange(n_joints)
    return Reading("", (), "", (), one, np.zeros(n_joints), one, own, own)


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of all recordings that readings are compared on: each (n, J), and the recording each is of (n,)."""

    q: Array
    qd: Array
    qdd: Array
    tau: Array
    run: Index

    def under(self, reading: Reading) -> "Samples":
        """The samples as another reading has them."""
        k = reading.time
        return replace(
            self,
            q=self.q[:, reading.source] * reading.factor + reading.offset,
            qd=self.qd[:, reading.source] * reading.factor / k,
            qdd=self.qdd[:, reading.source] * reading.factor / k**2,
            tau=self.tau[:, reading.torque_source] * reading.torque_factor,
        )
