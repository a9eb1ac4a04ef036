"""What the sensor-equipped arm is for: torques of a flight arm without sensors, predicted with a band.

Same size, same mass, same rig; another motion, and limbs that are tubes, not cages: stiff in twist. The prediction is
the rigid arm with the friction that was identified on the other arm. Its band is twice the RMS that this model left on
the held-out recording there: what friction does not explain on the one arm is not promised of the other.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from ...identification.fitting.experiment import load_experiments
from ...models.inertia import Array
from ...models.model import Model
from ...models.rigid_body import RigidBody
from ...recordings.write import write_recording
from .concealed import conceal
from .motion import DURATION, TRAIN, JointMoves, varied
from .plant import Plant, simulate
from .study import Friction

STIFFER = 10.0
"""A flight limb's torsional stiffness over that of the cage, chosen."""
TORQUE_LIMIT = 1000.0
"""Of a flight joint [N·m], chosen: of the order of what joints of arms of this class are rated for."""
_SEED = 36


@dataclass(frozen=True, eq=False)
class Flight:
    """Torques: time (n,), measured (by the plant alone) and predicted (n, 7), half-width of the band (7,)."""

    time: Array
    measured: Array
    predicted: Array
    band: Array

    @property
    def coverage(self) -> Array:
        """Share of the time inside the band (7,)."""
        return np.mean(np.abs(self.measured - self.predicted) <= self.band, axis=0)

    @property
    def loads(self) -> Array:
        """Largest predicted torque, its band on top, over the joint's limit (7,)."""
        return (np.abs(self.predicted) + self.band).max(axis=0) / TORQUE_LIMIT


def flight_arm(model: Model, friction: Friction, folder: Path, kind: str, seed: int = 0) -> Flight:
    """Simulate a flight arm on the rig of `make_recordings`, and predict its torques from the friction found."""
    rig = conceal(kind, seed).plant
    booms = [link.boom for link in rig.arm.links if link.boom is not None]
    arm = rig.arm.with_booms(torsion=STIFFER * booms[0].torsion, misfit=0.0)
    plant: Plant = replace(rig, arm=arm)
    motion = JointMoves(varied(TRAIN, np.random.default_rng(_SEED)))
    record = simulate(plant, motion, DURATION, seed=_SEED)
    columns = {f"q.{joint}": ("time", record.q[:, k]) for k, joint in enumerate(arm.joints)}
    columns |= {f"tau.{joint}": ("time", record.tau[:, k]) for k, joint in enumerate(arm.joints)}
    path = folder / "flight.parquet"
    write_recording(xr.Dataset(columns, coords={"time": record.time}), path)
    (flown,) = load_experiments(model, [path], RigidBody(model.tree), friction.experiments[0].motion.band)
    band = flown.motion.to_band
    predicted = band(friction.fit.assembly.torque(flown, friction.fit.theta))
    left = friction.holdout.measured - friction.holdout.friction
    width = 2 * np.sqrt(np.mean(left**2, axis=0))
    return Flight(band(flown.motion.time), flown.measured, predicted, width)
