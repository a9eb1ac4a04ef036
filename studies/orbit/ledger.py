"""Where momentum and energy of a capture in orbit are, at each communication point; and two captures compared."""

from dataclasses import dataclass

import numpy as np

from ...cosim.record import Run
from ...models.floating.dynamics import kinetic_energy
from ...models.floating.space_arm import ROTOR_INERTIA
from ...models.inertia import Array
from ...models.monolithic.assembly import makkar
from .setting import JointResistance, OrbitCapture, Setting, column, columns

WINDOW = 0.05
"""Over which forces are averaged before they are compared [s]."""


@dataclass(frozen=True)
class Momentum:
    """Shares (n, 6) of the momentum: linear [N·s], angular about the world's origin [N·m·s].

    Parameters
    ----------
    snare : array (n, 6)
        Of cables and floating target.
    arm : array (n, 6)
        Of base and arm, and of a target that is fixed to the base.
    scale : array (2,)
        What was exchanged at most, linear and angular: the impulse on the end effector, and its moment.
    """

    snare: Array
    arm: Array
    scale: Array

    @property
    def drift(self) -> float:
        """Largest change of the total over what was exchanged, linear or angular, the worse."""
        total = self.snare + self.arm
        change = np.abs(total - total[0]).reshape(-1, 2, 3)
        return float((np.linalg.norm(change, axis=2).max(axis=0) / self.scale).max())


def momentum_ledger(run: Run, capture: OrbitCapture) -> Momentum:
    """Read from a run's recording."""
    shares = [
        np.hstack([columns(run.recording, f"{owner}.momentum.{kind}") for kind in ("linear", "angular")])
        for owner in ("snare", "arm")
    ]
    steps = np.diff(capture.impulse, axis=0, prepend=0.0)
    turning = np.cumsum(np.cross(capture.tip[:, 0], steps), axis=0) + capture.angular_impulse
    scale = [np.linalg.norm(x, axis=1).max() for x in (capture.impulse, turning)]
    return Momentum(shares[0], shares[1], np.maximum(scale, 1e-300))


def energy_ledger(run: Run, capture: OrbitCapture, start: Setting, passive: JointResistance) -> dict[str, Array]:
    """Energies (n,) since the start [J]: ``motor`` is what the ring's motor has put in, the others where it is now.

    ``residual``: the motor's work less all else, the error of all steps and couplings.
    """
    table = run.recording
    snare = {name: column(table, f"snare.energy.{name}") for name in ("ring_motor", "strain", "kinetic", "overlap")}
    lost = column(table, "snare.energy.damped"), column(table, "snare.energy.friction")
    rotation = capture.base[:, 3:]
    twist = np.hstack([np.einsum("nji,nj->ni", rotation, capture.base[:, k]) for k in (1, 2)])
    rates = capture.qd
    rubbing = np.einsum("nj,nj->n", makkar(passive.friction, rates)[0], rates)
    bent = 0.5 * passive.stiffness * np.sum((capture.q - capture.q[0]) ** 2, axis=1)
    ledger = {
        "motor": snare["ring_motor"],
        "cables, strain": snare["strain"] - snare["strain"][0],
        "cables, motion": snare["kinetic"],
        "contacts": snare["overlap"],
        "target": column(table, "snare.energy.target"),
        "base, arm and rotors": kinetic_energy(start.arm, capture.q, twist, rates)
        + 0.5 * ROTOR_INERTIA * np.sum(rates**2, axis=1),
        "joints' springs": bent,
        "lost in cables and contacts": lost[0] + lost[1],
        "lost in joints": np.concatenate([[0.0], np.cumsum(_middle(rubbing) * np.diff(capture.times))]),
    }
    return ledger | {"residual": ledger["motor"] - sum(ledger[name] for name in ledger if name != "motor")}


def _middle(values: Array) -> Array:
    return 0.5 * (values[1:] + values[:-1])


def position_error(capture: OrbitCapture, reference: OrbitCapture, end: float = np.inf) -> float:
    """Largest distance [m] between the pin's places in the end effector's frame, at the reference's times to ``end``
    [s]."""
    own = np.column_stack([np.interp(reference.times, capture.times, x) for x in capture.relative.T])
    return float(np.linalg.norm(own - reference.relative, axis=1)[reference.times < end + 1e-9].max())


def force_error(capture: OrbitCapture, reference: OrbitCapture, end: float = np.inf, window: float = WINDOW) -> float:
    """RMS of the difference of the forces on the end effector over the RMS of the reference's, both means over a
    ``window`` [s], to ``end`` [s]."""
    (_, ours), (middles, theirs) = capture.mean_force(window), reference.mean_force(window)
    n = int(np.sum(middles < end))
    ours, theirs = ours[:n], theirs[:n]
    return float(np.sqrt(np.sum((ours - theirs) ** 2) / np.sum(theirs**2)))


def peak_force(capture: OrbitCapture) -> float:
    """Largest force on the end effector, averaged over 10 ms [N]."""
    return float(np.linalg.norm(capture.mean_force(0.01)[1], axis=1).max())
