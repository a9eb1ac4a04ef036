"""Latch play: a latch's joints are loose, so that its ball can move before the latch's stiffness holds it."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols

_NEVER_ZERO = 1e-12  # [m]


def _law(s: Symbols, p: Symbols) -> ca.SX:
    drawn = s["drawn"]
    size = ca.sqrt(ca.dot(drawn, drawn) + _NEVER_ZERO**2)
    return s["stiffness"] * drawn * ca.fmin(1.0, 0.5 * p["play"] / size)


EFFECT = Effect(
    name="latch_play",
    family="docking",
    at="latches",
    sentence="the latches have play: the target moves before they bear",
    equation="stiffness of a latch acts beyond play/2 from where it took hold, in every direction",
    source="Nordin and Gutman (2002), the dead zone",
    parameters=(Parameter("play", "m", "free travel of a latch, both ways together", low=0.0, high=0.01,
                          grid=(1e-4, 3e-4, 1e-3)),),
    law=_law,
    experiment="push the target off against the closed {at} beyond their preload, and draw its motion over the force",
)  # fmt: skip
