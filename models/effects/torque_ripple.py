"""Torque ripple: a torque that repeats with position whatever the speed, from cogging or gear teeth.

The length of the wave is a ``period`` in the joint's own unit [S], not a frequency: it reads as a tooth or a screw's
lead, and needs no word on cycles or radians.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    phase = 2 * ca.pi * s["q"] / p["period"]
    return p["cosine"] * ca.cos(phase) + p["sine"] * ca.sin(phase)


EFFECT = Effect(
    name="torque_ripple",
    family="drive train",
    at="joint",
    sentence="torque that ripples with position, in the same places in both directions",
    equation="cosine * cos(2*pi*q/period) + sine * sin(2*pi*q/period)",
    source="Holtz and Springob (1996)",
    parameters=(
        Parameter("cosine", "T", "ripple in phase with the cosine of position"),
        Parameter("sine", "T", "ripple in phase with the sine of position"),
        # Teeth and poles go by the turn, the travel by the motion: no period is a share of it. The grid is for those
        # to whom each point is a simulation.
        Parameter(
            "period",
            "S",
            "travel after which the ripple repeats",
            zero=0.1,
            low=1e-4,
            high=0.6,
            grid=tuple(1 / periods for periods in range(2, 25)),
            relative_to="travel",
            periodic_over="q",
        ),
    ),
    law=_law,
    series=True,
    experiment="run {at} slowly to and fro over its whole travel and average the torques of both directions "
    "position by position",
)
