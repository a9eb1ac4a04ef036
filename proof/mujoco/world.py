"""What a real machine adds to every case: a URDF that is off, torques that wander, encoders and clocks as they are."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench.arm import Arm
from bench.parts import Disturbance

from ..cases import RECORDINGS, Case
from ..drives.motions import COLOURED, WANDERING
from ..plant import ProofPlant
from .faults import FAULTS

Rng = np.random.Generator
Columns = Mapping[str, NDArray]

ERROR = (0.01, 0.05)
"""Share by which the URDF has every mass, centre and inertia wrong."""

BITS = (12, 24)


@dataclass(frozen=True)
class World:
    """Errors of the URDF by link: factors on mass, inertia and centre of mass, (n_links, 5); ``disturbance`` of every
    joint; ``bits`` a turn of the logged encoder, ``rough``: its noise before it counts [steps]; ``jitter`` of the time
    stamps [sampling periods]; ``seed`` of both.
    """

    off: NDArray
    disturbance: Disturbance
    bits: int
    rough: float
    jitter: float
    seed: int

    @staticmethod
    def random(case: Case, kind: str, rng: Rng) -> "World":
        """The world of a case, whose disturbance is of this kind."""
        n, rms = len(case.plant.arm.links), case.answer.disturbance
        off = 1.0 + rng.choice([-1.0, 1.0], (n, 5)) * rng.uniform(*ERROR, (n, 5))
        own = next(iter(case.plant.disturbance.values()))
        if kind == COLOURED:
            own = Disturbance(rms, 0.05, float(np.exp(rng.uniform(np.log(0.3), np.log(3.0)))))
        elif kind == WANDERING:
            own = Disturbance(rms, 0.02, float(rng.uniform(0.05, 0.2)))
        bits, rough, jitter = int(rng.integers(*BITS)), float(rng.uniform(0.0, 0.7)), float(rng.uniform(0.0, 0.02))
        return World(off, own, bits, rough, jitter, int(rng.integers(2**31)))

    def of(self, plant: ProofPlant) -> ProofPlant:
        """A plant in this world; URDF and servo keep believing in its nominal arm."""
        real = _off(plant.arm if plant.real is None else plant.real, self.off)
        return replace(plant, real=real, disturbance=dict.fromkeys(plant.arm.joints, self.disturbance))

    def logged(self, name: str, columns: Columns, fault: str = "") -> dict[str, NDArray]:
        """A recording as it is logged, by its name of `RECORDINGS`, with a fault of `FAULTS` where one is asked for."""
        rng = np.random.default_rng([self.seed, RECORDINGS.index(name)])
        time, step = columns["time"], 2.0 * np.pi / 2.0**self.bits
        stamps = time + self.jitter * (time[1] - time[0]) * rng.standard_normal(len(time))
        found = {**columns, "time": stamps - stamps[0]}
        for channel, read in columns.items():
            if channel.startswith("q."):
                found[channel] = step * np.round(read / step + self.rough * rng.standard_normal(len(time)))
        if fault:
            chance = np.random.default_rng(self.seed)
            found = FAULTS[fault](found, int(chance.integers(1, len(self.off))), chance)
        return found


def _off(arm: Arm, factors: NDArray) -> Arm:
    links = [
        replace(link, mass=link.mass * float(f[0]), inertia=link.inertia * float(f[1]), com=link.com * f[2:])
        for link, f in zip(arm.links, factors, strict=True)
    ]
    return Arm(tuple(links))
