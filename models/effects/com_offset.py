"""Centre-of-mass offset: the link's mass sits elsewhere than the model says, its shape unchanged."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    mass, moment = s["phi"][0], s["phi"][1:4]
    shift = ca.vertcat(p["x"], p["y"], p["z"])
    # Steiner about the old and the new centre: m (c + d)(c + d)' - m c c', with m c the first moment.
    change = moment @ shift.T + shift @ moment.T + mass * shift @ shift.T
    inertia = ca.trace(change) * ca.SX.eye(3) - change
    return s["phi"] + ca.vertcat(
        0,
        mass * shift,
        inertia[0, 0],
        inertia[0, 1],
        inertia[0, 2],
        inertia[1, 1],
        inertia[1, 2],
        inertia[2, 2],
    )


EFFECT = Effect(
    name="com_offset",
    family="structure and mass",
    at="link",
    sentence="the link's centre of mass is not where the model puts it",
    equation="centre of mass + (x, y, z); the inertia about the centre of mass stays (Steiner's parallel-axis theorem)",
    source="Atkeson, An and Hollerbach (1986)",
    parameters=(
        Parameter("x", "m", "shift along the link frame's x axis"),
        Parameter("y", "m", "shift along the link frame's y axis"),
        Parameter("z", "m", "shift along the link frame's z axis"),
    ),
    law=_law,
    experiment="hold {at} still in several postures a quarter turn apart under gravity",
)
