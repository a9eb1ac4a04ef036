"""Every number of carriage, docking and latches, with its unit and its source or *chosen*.

No flight unit's stroke, motor, screw or latch preload is published. What is, are the forces of the Latching End
Effector of the space station's arm: rigidizing peaks at 1210 to 1272 lbf (5.38 to 5.66 kN) and drops by at most
100 lbf (445 N); `PRELOAD` is calibrated to that window.
"""

from dataclasses import dataclass, field, fields, replace
from math import isfinite, pi, radians
from typing import Any

from ...errors import InputError, nearest
from ..snare.parameters import Dimension, Kind

PRELOAD = 5500.0
"""Axial force that the carriage pulls with before the latches close [N]; calibrated to `PRELOAD_WINDOW`."""
PRELOAD_WINDOW = (5380.0, 5660.0)
"""Peak of the rigidizing force in nominal captures [N]: 1210 and 1272 lbf (process_SSRMS_LEE_data.m)."""
RESIDUAL, RESIDUAL_ANGLE = 1.5e-3, radians(0.9)
"""What a docking mechanism of 4.5 t ends within [m, rad] (Scientific Reports, s41598-025-88757-z, table 1)."""


def _number(value: float, unit: str, source: str, allowed: str = "> 0", kind: Kind = "chosen") -> Any:
    return field(default=value, metadata={"unit": unit, "kind": kind, "source": source, "allowed": allowed})


_SKETCH = "end effector of the SSRMS's class, no number published"


@dataclass(frozen=True)
class DockingParameters:
    """Numbers of the rigid half; `dimensions` lists each with unit and source.

    The end effector's frame is the snare's: x along its axis, towards the target. The target's frame has its origin at
    the foot of the pin. Seated, both have the same axes and the foot stands at ``seat`` on the end effector's x. The
    carriage carries the snare and moves along −x; its travel s is 0 where the fixed ring lies at x = 0.

    Raises
    ------
    InputError
        For a value that is not finite or not in its range.
    """

    radius: float = _number(0.15, "m", f"{_SKETCH}; outside the rings")
    seat: float = _number(
        0.08, "m", "with a foot at 0.12 m the gap is 40 mm: grooves 20 mm deep clear a tilt of 2 degrees"
    )
    flank: float = _number(pi / 4, "rad", "flank to axis; 45 degrees are usual in kinematic couplings", "< pi/2")
    half_width: float = _number(0.02, "m", "takes 10 mm each way and 2 degrees of roll: 19.4 mm")
    edge: float = _number(0.005, "m", "rounding of a groove's edge, as the ball's centre follows it")
    stiffness: float = _number(
        1e7, "N/m", "of one flank: Hertz at a crown of 100 mm, 2e8, with the structure in series"
    )
    restitution: float = _number(0.3, "1", "of a contact at `restitution_speed`", "< 1")
    restitution_speed: float = _number(0.01, "m/s", "fastest approach that the control program asks for")
    friction: float = _number(0.15, "1", "hard coating on hard coating, dry", ">= 0")
    breakaway: float = _number(2e-5, "m", "presliding of a contact; as stiff as its normal direction at the preload")
    bristle_damping: float = _number(30.0, "s/m", "share of friction per speed of presliding", ">= 0")
    switch_travel: float = _number(5e-4, "m", "distance from its seat at which a ball closes its switch")
    front: float = _number(
        0.10, "m", "of the carriage at s = 0: the front ring; extended, it pushes a seated target off"
    )
    bumper_radius: float = _number(0.11, "m", "of three bumpers on the carriage's front; inside the rings")
    bumper_stiffness: float = _number(1e6, "N/m", "of a bumper")
    carriage_mass: float = _number(15.0, "kg", f"{_SKETCH}; rings, cables and their motor")
    lead: float = _number(0.005, "m", "ball screw")
    efficiency: float = _number(0.9, "1", "ball screw", "< 1")
    rotor: float = _number(2e-5, "kg*m**2", "motor and screw, at the screw")
    torque_limit: float = _number(6.5, "N*m", "at the screw: 7.35 kN; 5.5 kN take 4.9 N·m")
    stroke: float = _number(0.28, "m", "0.17 m along the pin, a gap of up to 60 mm, the cables' slack and stretch")
    coulomb: float = _number(20.0, "N", "seals and guides of the carriage", ">= 0")
    coulomb_speed: float = _number(1e-4, "m/s", "where the regularised Coulomb law bends")
    viscous: float = _number(200.0, "N*s/m", "guides of the carriage", ">= 0")
    drive_stiffness: float = _number(5e6, "N/m", "of the carriage's position loop")
    drive_damping: float = _number(2e4, "N*s/m", "of the carriage's position loop")
    brake_stiffness: float = _number(5e7, "N/m", "of the brake with the screw behind it")
    brake_damping: float = _number(3e4, "N*s/m", "of the brake with the screw behind it")
    stop_stiffness: float = _number(1e7, "N/m", "of the stops at both ends of the stroke")
    stop_damping: float = _number(2e4, "N*s/m", "of the stops at both ends of the stroke", ">= 0")
    latch_stiffness: float = _number(5e7, "N/m", "of one latch, each way, at its ball")
    latch_damping: float = _number(3e4, "N*s/m", "of one latch")
    latch_preload: float = _number(1000.0, "N", "of one latch; latches raise the rigidizing preload", ">= 0")
    latch_time: float = _number(3.0, "s", "from open to closed; the SRMS rigidizes within 4 s")

    def __post_init__(self) -> None:
        """Refuse what cannot be built."""
        for item in fields(self):
            value, allowed = getattr(self, item.name), item.metadata["allowed"]
            fits = {"> 0": value > 0, ">= 0": value >= 0, "< 1": 0 < value < 1, "< pi/2": 0 < value < pi / 2}[allowed]
            if not (isfinite(value) and fits):
                wanted = f"more than 0 and {allowed}" if allowed.startswith("<") else allowed
                raise InputError(f"docking: {item.name} is {value:g} {item.metadata['unit']}; give {wanted}")

    def dimensions(self) -> tuple[Dimension, ...]:
        """Every number with unit and source, in the order of the fields."""
        found = []
        for item in fields(self):
            value, m = getattr(self, item.name), item.metadata
            given = value != item.default
            source, kind = ("set by the caller", "given") if given else (m["source"], m["kind"])
            found.append(Dimension(item.name, value, m["unit"], source, kind))
        return tuple(found)

    def values(self) -> dict[str, float]:
        """Every number by its name."""
        return {item.name: float(getattr(self, item.name)) for item in fields(self)}

    def with_values(self, **values: float) -> "DockingParameters":
        """A copy with other values; raises InputError for a name that does not exist."""
        known = self.values()
        for name in values:
            if name not in known:
                raise InputError(f"docking: no parameter '{name}'; nearest is '{nearest(name, known)}'")
        return replace(self, **values)
