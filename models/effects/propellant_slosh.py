"""Propellant slosh: a part of the liquid swings in its tank against the base, at low frequency.

Spring-mass analogue of the lowest mode, one mass for each axis of the base: equal ones where a surface-tension device
holds the liquid in the middle of a round tank, none along the axis of a pendulum. The base's own inertia, in the model,
holds the sloshing mass as if it were rigid, and the law gives what its moving adds to that: far below the frequency a
sloshing mass is a part of the base, so that no recording could tell the two apart. Mass and frequency show apart only
near the frequency or above it; below, mass / frequency² does.

The mass moves in the base's turning axes. At a spin of 0.1 rad/s and 0.25 Hz its Coriolis acceleration is an eighth of
the spring's: left out, a fit made 62 kg of 40 kg. It starts at rest against the base, and so should a recording: half a
minute may pass until a wrong start has died out.
"""

from dataclasses import replace

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._oscillators import DAMPING, FREQUENCY, STATES

_NONE = 1e-12
"""[kg] Keeps shares finite where nothing sloshes."""


def _axes(p: Symbols, name: str) -> ca.SX:
    return ca.vertcat(*(p[f"{name}{axis}"] for axis in "xyz"))


def _free(p: Symbols) -> tuple[ca.SX, ca.SX]:
    """The largest mass, and each axis' share of it (3,): how freely it moves along that axis."""
    masses = _axes(p, "mass_")
    largest = ca.fmax(ca.fmax(masses[0], masses[1]), masses[2]) + _NONE
    return largest, masses / largest


def _turned(s: Symbols, point: ca.SX) -> ca.SX:
    """Acceleration of a point that is fixed in the base, against the origin of the base's frame (3,)."""
    return ca.cross(s["spin_rate"], point) + ca.cross(s["spin"], ca.cross(s["spin"], point))


def _motion(s: Symbols, p: Symbols) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Displacement [m]; second rate of the oscillators; acceleration of the place where the mass rests, and what the
    mass has beyond it [m/s²]; each (3,)."""
    w, share = 2 * ca.pi * p["frequency"], _free(p)[1]
    shift, speed = (ca.vertcat(*(s[name] for name in part)) for part in (STATES[:3], STATES[3:]))
    place = s["acceleration"] + _turned(s, _axes(p, ""))
    turning = _turned(s, share * shift) + 2 * ca.cross(s["spin"], share * speed)
    second = -place - turning - 2 * p["damping"] * w * speed - w**2 * shift
    return share * shift, second, place, share * second + turning


def _rate(s: Symbols, p: Symbols) -> list[ca.SX]:
    return [*(s[name] for name in STATES[3:]), *ca.vertsplit(_motion(s, p)[1])]


def _law(s: Symbols, p: Symbols) -> ca.SX:
    shift, _, place, beyond = _motion(s, p)
    mass = _free(p)[0]
    force = -mass * beyond
    return ca.vertcat(force, ca.cross(_axes(p, ""), force) - mass * ca.cross(shift, place + beyond))


EFFECT = Effect(
    name="propellant_slosh",
    family="free-floating base",
    at="base",
    sentence="liquid sloshes in a tank and pushes the base to and fro",
    equation=(
        "force -mass * b at r = (x, y, z), moment -mass * e x (a + b) about r: a the acceleration of r on the base, "
        "a + b that of r + e; along each axis e'' = -a - 2 damping w e' - w² e - turning terms, w = 2 pi frequency"
    ),
    source="Abramson (1966), The dynamic behavior of liquids in moving containers, NASA SP-106 (spring-mass analogue)",
    parameters=(
        *(
            Parameter(f"mass_{a}", "kg", f"mass that sloshes along the base's {a} axis", low=0.0, alone=False)
            for a in "xyz"
        ),
        *(Parameter(a, "m", f"the tank's place along the base's {a} axis", grid=(0.0,)) for a in "xyz"),
        replace(FREQUENCY, grid=FREQUENCY.grid[::2]),  # tried for a mass in each axis too
        DAMPING,
    ),
    law=_law,
    states=STATES,
    rate=_rate,
    experiment="stop the arm of {at} at once and record how base velocity and spin ring with the joints locked",
)
