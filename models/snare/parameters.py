"""Every dimension of the snare, with its unit, its source, and whether it was given, chosen or calibrated.

The paper (Li, Liang, Wu, Liu, Zhang: soft capture by the end effector of a space manipulator, 3-D ANCF cables) states
what drives the cables and what they are made of, not the sizes of rings, pin and cable. Those are *calibrated* against
its stated first contact on the ground (2.6 s): a match of that time is therefore no validation.
"""

from dataclasses import dataclass, field, fields, replace
from math import hypot, isfinite, pi
from typing import Any, Literal

from ...errors import InputError

Kind = Literal["paper", "calibrated", "derived", "chosen", "given"]
_CONTACT_TIME = "first contact of the ground test, 2.6 s"


@dataclass(frozen=True)
class Dimension:
    """One number of the snare.

    Parameters
    ----------
    name, unit : str
        Field of `SnareParameters`; pint's spelling, ``1`` for a plain number.
    value : float
    source : str
        Where the number is from; for a calibrated one, what it was calibrated against.
    kind : "paper", "calibrated", "derived", "chosen" or "given"
        ``derived``: follows from others by what the paper says. ``chosen``: typical of such hardware, or numerical,
        without a source. ``given``: set by the caller.
    """

    name: str
    value: float
    unit: str
    source: str
    kind: Kind


def _dimension(value: float, unit: str, kind: Kind, source: str, allowed: str = "> 0") -> Any:
    return field(default=value, metadata={"unit": unit, "kind": kind, "source": source, "allowed": allowed})


@dataclass(frozen=True)
class SnareParameters:
    """Dimensions of rings, cables, pin and contact; `dimensions` lists each with unit and source.

    `bending_damping` acts on the rate of the curvature's size and leaves a swing of a cable about its chord alone;
    `end_friction`, in the bearings, brakes that swing. Without it first contact comes some 60 ms earlier, and what
    follows depends so much on what was before that results converge slowly with the step.

    The end effector's frame has x along its axis: the fixed ring lies at x = 0, the rotating one at `ring_distance`.
    The target's frame has its origin at the foot of the pin, which points along −x and ends in a knob.

    Raises
    ------
    InputError
        For a value that is not finite or not in its range.
    """

    ring_radius: float = _dimension(0.127, "m", "calibrated", _CONTACT_TIME)
    ring_distance: float = _dimension(0.10, "m", "chosen", "axial distance of the rings; not in the paper")
    cable_length: float = _dimension(0.2842, "m", "derived", "lies against the rings' wall (Li et al.): `wall_length`")
    cable_diameter: float = _dimension(0.004, "m", "chosen", "wire rope of 4 mm; not in the paper")
    young_modulus: float = _dimension(20e9, "Pa", "paper", "Li et al., ground test")
    density: float = _dimension(7800.0, "kg/m**3", "paper", "Li et al., ground test")
    bending_damping: float = _dimension(1e-3, "s", "chosen", "ratio of damping to stiffness in bending", ">= 0")
    axial_damping: float = _dimension(1e-4, "s", "chosen", "ratio of damping to stiffness in tension", ">= 0")
    end_friction: float = _dimension(
        2e-3, "N*m*s/rad", "chosen", "of a cable's bearing on the fixed ring; not in the paper", ">= 0"
    )
    end_stiffness: float = _dimension(0.0, "N*m/rad", "chosen", "spherical joints, as in the paper", ">= 0")
    ring_rate: float = _dimension(8 * pi / 180, "rad/s", "paper", "Li et al.: 8 deg/s")
    ring_travel: float = _dimension(80 * pi / 180, "rad", "paper", "Li et al.: 80 deg")
    ring_direction: float = _dimension(
        -1.0, "1", "calibrated", f"{_CONTACT_TIME}; about +x; turning the other way it would be 3.5 s", "1 or -1"
    )
    ring_ramp: float = _dimension(0.1, "s", "chosen", "time in which the ring starts and stops")
    pin_radius: float = _dimension(0.0075, "m", "calibrated", _CONTACT_TIME)
    pin_length: float = _dimension(0.26, "m", "chosen", "reaches through both rings in the ground test")
    knob_radius: float = _dimension(0.018, "m", "chosen", "a pin with a knob is drawn, without numbers")
    knob_length: float = _dimension(0.02, "m", "chosen", "a pin with a knob is drawn, without numbers")
    hertz_stiffness: float = _dimension(1.66e9, "N/m**1.5", "chosen", "steel wire on a steel pin")
    contact_damping: float = _dimension(1.0, "s/m", "chosen", "Hunt and Crossley 1975: share of force per m/s", ">= 0")
    friction: float = _dimension(0.1, "1", "chosen", "polished pin; the paper says small", ">= 0")
    slip_velocity: float = _dimension(2e-4, "m/s", "chosen", "where the regularised Coulomb law bends")
    cable_pretension: float = _dimension(0.0, "N", "chosen", "of a cable held straight; not in the paper", ">= 0")

    def __post_init__(self) -> None:
        """Refuse what cannot be built."""
        for item in fields(self):
            value, allowed = getattr(self, item.name), item.metadata["allowed"]
            fits = {"> 0": value > 0, ">= 0": value >= 0, "1 or -1": abs(value) == 1}[allowed]
            if not (isfinite(value) and fits):
                raise InputError(f"snare: {item.name} is {value:g} {item.metadata['unit']}; give {allowed}")
        if self.knob_length >= self.pin_length:
            raise InputError(
                f"snare: knob_length is {self.knob_length:g} m; make it shorter than pin_length, {self.pin_length:g} m"
            )

    @property
    def cable_radius(self) -> float:
        """Half the cable's diameter [m]."""
        return self.cable_diameter / 2

    @property
    def mass_per_length(self) -> float:
        """ρA of the cable [kg/m]."""
        return self.density * pi * self.cable_diameter**2 / 4

    @property
    def axial_stiffness(self) -> float:
        """EA of the cable [N]."""
        return self.young_modulus * pi * self.cable_diameter**2 / 4

    @property
    def bending_stiffness(self) -> float:
        """EI of the cable [N·m²]."""
        return self.young_modulus * pi * self.cable_diameter**4 / 64

    @property
    def section(self) -> tuple[float, ...]:
        """What `cable_energies` takes: ρA [kg/m], EA [N], EI [N·m²], damping of tension and bending [s], prestrain."""
        stiffness = self.axial_stiffness, self.bending_stiffness
        return (self.mass_per_length, *stiffness, self.axial_damping, self.bending_damping, self.prestrain)

    @property
    def prestrain(self) -> float:
        """Axial strain that the pretension stands for: by this share the cable, left free, would be shorter."""
        return self.cable_pretension / self.axial_stiffness

    def dimensions(self) -> tuple[Dimension, ...]:
        """Every number with unit and source, in the order of the fields."""
        return tuple(_described(item, getattr(self, item.name)) for item in fields(self))

    def with_values(self, **values: float) -> "SnareParameters":
        """A copy with other values; raises InputError for a name that does not exist."""
        known = [item.name for item in fields(self)]
        for name in values:
            if name not in known:
                raise InputError(f"snare: no parameter '{name}'; known: {', '.join(known)}")
        return replace(self, **values)


def _described(item: Any, value: float) -> Dimension:
    if value == item.default:
        return Dimension(item.name, value, item.metadata["unit"], item.metadata["source"], item.metadata["kind"])
    return Dimension(item.name, value, item.metadata["unit"], "set by the caller", "given")


def wall_length(ring_radius: float, ring_distance: float) -> float:
    """Length of a cable that lies against the wall of both rings over 120°: √(h² + (2πR/3)²) [m]."""
    return hypot(ring_distance, 2 * pi * ring_radius / 3)


WIDE_RING = SnareParameters(ring_radius=0.132, pin_radius=0.0115, cable_length=wall_length(0.132, 0.1))
"""A second set that meets the paper's contact time as well: what the calibration leaves open."""
