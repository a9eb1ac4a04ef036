"""Wheel friction: the bearings of reaction wheels drag at the base, against the wheels' turning in it.

One wheel along each axis of the base, all of the same inertia; an axis without one has no friction. Nobody needs to
record how fast they turn: that follows from what they were told to give, which a recording has as ``torque.wheels.x``
and so on [N·m, on the base, in its axes], and from the base's own spin. Without those channels the wheels are idle,
and only left behind when the base turns. They stand still in the base where a recording begins. A wheel that is a
joint of the URDF, with q, qd and tau recorded, has the friction of a joint instead: `viscous_friction` and
`coulomb_friction` there.

What a wheel was told fixes its momentum, not its speed, so that viscous friction shows as the share of its momentum
that it loses in a second: the coefficient over the inertia. The inertia itself shows in wheels that idle, and hardly
in driven ones. The base's inertia, in the model, is without what the wheels have about their own axes.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols

SLOW = 1e-3
"""[rad/s] Over which the sign of a wheel's speed is smoothed at least: far below what a wheel turns at."""

SOON = 0.1
"""[s] And over what friction takes off the wheel in this time: a wheel comes to rest no faster, so that no recording
is too coarse to follow it."""

_STATES = ("given_x", "given_y", "given_z")


def _axes(of: Symbols, name: str) -> ca.SX:
    return ca.vertcat(*(of[f"{name}_{axis}"] for axis in "xyz"))


def _drag(s: Symbols, p: Symbols) -> ca.SX:
    """Moment on the base (3,) [N·m]; what the base was given, each wheel has lost."""
    momentum = -(s["impulse"] + _axes(s, "given")) - p["inertia"] * s["spin_gained"]
    coulomb = _axes(p, "coulomb")
    sign = ca.tanh(momentum / (p["inertia"] * SLOW + coulomb * SOON))
    return _axes(p, "loss") * momentum + coulomb * sign


def _law(s: Symbols, p: Symbols) -> ca.SX:
    # The momentum of a wheel turns with the base: what friction took of it no longer does.
    return ca.vertcat(0, 0, 0, _drag(s, p) + ca.cross(s["spin"], _axes(s, "given")))


EFFECT = Effect(
    name="wheel_friction",
    family="free-floating base",
    at="base",
    sentence="reaction wheels drag at the base through the friction of their bearings",
    equation=(
        "moment f + spin x g, g' = f = loss * H + coulomb * sgn(H) about each axis, momentum of the wheel in the base "
        "H = -impulse told - g - inertia * spin gained; the sign smoothed over what 0.1 s of friction takes"
    ),
    source="Wertz (1978), section 7.9 (reaction wheel models)",
    parameters=(
        *(
            Parameter(
                f"loss_{a}", "1/s", f"viscous coefficient over inertia of the wheel along {a}", low=0.0, alone=False
            )
            for a in "xyz"
        ),
        *(
            Parameter(f"coulomb_{a}", "N*m", f"friction level of the wheel along {a}", low=0.0, alone=False)
            for a in "xyz"
        ),
        Parameter(
            "inertia",
            "kg*m^2",
            "of one wheel about its axis",
            zero=0.1,
            low=1e-4,
            high=1e4,
            grid=(0.01, 0.03, 0.1, 0.3, 1.0, 10.0, 1000.0),
        ),
    ),
    law=_law,
    states=_STATES,
    rate=lambda s, p: ca.vertsplit(_drag(s, p)),
    from_zero=True,
    experiment="spin the wheels of {at} up and let them run down with the joints locked, and record their torque",
)
