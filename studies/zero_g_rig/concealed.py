"""What the plant conceals from the model: one thing at a time, its place and size drawn at random."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.rig.kinematics import SUSPENSION
from ...models.rig.rig import built_in_rig
from .arm import Arm, arm_of
from .plant import Plant, Sensors
from .slide import Slide
from .suspension import Suspension

Array = NDArray[np.float64]

KINDS = (
    "link_torsion",
    "none",
    "sling_tension_error",
    "hang_point_clearance",
    "suspension_sway",
    "sensor_drift",
)
"""The first is what the paper suspects of its joint 2: a twisted boom, on slings that keep their height."""


@dataclass(frozen=True, eq=False)
class ConcealedCase:
    """A plant, and the name, place and size of what it has and the model has not; ``None`` everywhere for nothing.

    ``beside`` is a second effect, (name, place, size, unit), without which the first would not be felt."""

    plant: Plant
    name: str | None
    at: str | None
    size: float | None
    unit: str | None
    beside: tuple[str, str, float, str] | None = None

    def answer(self) -> dict[str, Any]:
        """All that a score needs: the effect, and each slide's friction law."""
        slide, arm = self.plant.slide, self.plant.arm
        if slide is None:
            raise ValueError("a plant without slides has no answer")
        names = ("coulomb", "static", "stribeck_speed", "viscous", "deflection", "creep")
        laws = np.broadcast_arrays(*(np.asarray(getattr(slide, n), float) for n in names), np.zeros(len(arm.contacts)))
        friction = {
            arm.joints[c.link]: {n: float(x[k]) for n, x in zip(names, laws, strict=False)}
            | {"radius": float(np.linalg.norm(c.point))}
            for k, c in enumerate(arm.contacts)
        }
        effect = None if self.name is None else {"name": self.name, "at": self.at, "size": self.size, "unit": self.unit}
        beside = None if self.beside is None else dict(zip(("name", "at", "size", "unit"), self.beside, strict=True))
        return {"effect": effect, "beside": beside, "friction": friction}


def conceal(kind: str, seed: int) -> ConcealedCase:
    """A rig with friction of its own that conceals one kind of effect.

    Raises
    ------
    ValueError
        Another kind than those in KINDS.
    """
    if kind not in KINDS:
        raise ValueError(f"kind = {kind!r}; allowed are {', '.join(KINDS)}")
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    arm = arm_of(built_in_rig())
    plant = Plant(arm, _slides(arm, rng), Suspension())
    one = np.zeros(len(arm.units))
    # Slings on the outer half of the arm: further in, levers are centimetres and nothing can show.
    outer = int(rng.integers(4, len(arm.units)))
    sign = float(rng.choice([-1.0, 1.0]))
    spread = float(rng.uniform(0.8, 1.25))
    if kind == "link_torsion":
        boom, misfit, held = 2, sign * 0.0015 * spread, 700.0
        hung = replace(plant, arm=arm.with_boom(boom, misfit=misfit), suspension=Suspension(height_stiffness=held))
        beside = "suspension_stiffness", SUSPENSION, held, "N/m"
        return ConcealedCase(hung, kind, f"link{boom + 1}", misfit, "rad", beside)
    if kind == "sling_tension_error":
        one[outer] = sign * 0.03 * spread
        return ConcealedCase(
            replace(plant, suspension=Suspension(error=one)), kind, arm.units[outer].name, one[outer], "1"
        )
    if kind == "hang_point_clearance":
        one[outer] = 0.012 * spread
        return ConcealedCase(
            replace(plant, suspension=Suspension(play=one)), kind, arm.units[outer].name, one[outer], "m"
        )
    if kind == "suspension_sway":
        one[:] = Suspension.lag
        one[outer] = 1.0 * spread
        return ConcealedCase(
            replace(plant, suspension=Suspension(lag=one)), kind, arm.units[outer].name, one[outer], "s"
        )
    if kind == "sensor_drift":
        joint = int(rng.integers(0, len(arm.links)))
        drift = np.zeros(len(arm.links))
        drift[joint] = sign * 4.0 * spread
        hung = replace(plant, sensors=Sensors(torque_drift=tuple(drift)))
        return ConcealedCase(hung, kind, f"tau.{arm.joints[joint]}", drift[joint], "N*m")
    return ConcealedCase(plant, None, None, None, None)


def _slides(arm: Arm, rng: np.random.Generator) -> Slide:
    """Dry plain slides: one friction coefficient a unit, the same at its two contacts; a little Stribeck, a little
    viscous."""
    units = [c.link for c in arm.contacts]
    load = np.array([c.load for c in arm.contacts])
    draw = {link: rng.uniform([0.08, 1.2, 1.5e-3, 0.5], [0.12, 1.6, 3e-3, 1.5]) for link in sorted(set(units))}
    coefficient, ratio, speed, viscous = np.array([draw[link] for link in units]).T
    return Slide(
        coulomb=coefficient * load,
        static=ratio * coefficient * load,
        stribeck_speed=speed,
        viscous=viscous * load,
        creep=0.002,
    )
