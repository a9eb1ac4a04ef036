"""Three equal oscillators on a base that accelerates, one for each axis: what bends there."""

import casadi as ca

from ..effect import Parameter, Symbols

STATES = ("shift_x", "shift_y", "shift_z", "speed_x", "speed_y", "speed_z")

FREQUENCY = Parameter(
    "frequency",
    "Hz",
    "undamped natural frequency with the base held",
    zero=0.3,
    low=0.01,
    high=20.0,
    grid=tuple(round(0.05 * 1.12**k, 4) for k in range(36)),
)

DAMPING = Parameter("damping", "1", "share of critical damping", zero=0.1, low=1e-5, high=1.0, grid=(0.1,))


def second_rates(s: Symbols, p: Symbols, driven: ca.SX) -> ca.SX:
    """Acceleration (3,) against the base: -driven - 2 damping w speed - w² shift, w = 2 pi frequency."""
    w = 2 * ca.pi * p["frequency"]
    shift, speed = (ca.vertcat(*(s[name] for name in part)) for part in (STATES[:3], STATES[3:]))
    return -driven - 2 * p["damping"] * w * speed - w**2 * shift


def rates(s: Symbols, p: Symbols, driven: ca.SX) -> list[ca.SX]:
    """Rates of the states, in their order."""
    return [*(s[name] for name in STATES[3:]), *ca.vertsplit(second_rates(s, p, driven))]
