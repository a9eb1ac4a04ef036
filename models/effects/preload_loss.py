"""Preload loss: a latch's preload fades after it has closed, as its seats embed and its springs relax.

One relaxation time (Maxwell); embedding of bolted joints is told likewise, as a share of the preload (VDI 2230).
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    lost = p["share"] * s["preload"] * (1 - ca.exp(-ca.fmax(s["since"], 0.0) / p["time"]))
    return ca.vertcat(-lost, 0, 0)


EFFECT = Effect(
    name="preload_loss",
    family="docking",
    at="latches",
    sentence="the latches lose preload after they have closed",
    equation="preload of a latch less share * preload * (1 - exp(-time since it began to close / time))",
    source="Maxwell (1867); VDI 2230-1 (2015), embedding",
    parameters=(
        Parameter("share", "1", "of the preload that is lost in the end", low=0.0, high=0.95, grid=(0.15, 0.5)),
        Parameter("time", "s", "relaxation time", zero=5.0, low=0.5, high=1e3, grid=(1.0, 5.0, 25.0)),
    ),
    law=_law,
    experiment="hold the preload for a while once the {at} have closed: their pull fades while nothing moves",
)
