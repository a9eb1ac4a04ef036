"""What a law is: the coordinate it runs over, whether it remembers or rings, where it is nonlinear; read off itself."""

import functools

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ...models.effect import Effect
from ...models.model import PlacedEffect
from ..fitting.assembly import TorqueModel


def remembers(p: PlacedEffect) -> bool:
    """Whether a law has a memory that is no drive's or link's own: a sling's carriage, a tank, a late sensor."""
    return bool(p.effect.states) and p.effect.at != "joint" and p.effect.acts_on == "torque"


def rings(p: PlacedEffect) -> bool:
    """Whether a law has a frequency of its own that no joint's motion gives: a tank, a boom on the base."""
    return bool(p.effect.states) and p.effect.at == "base"


def coordinate(effect: Effect) -> str | None:
    """Coordinate of a joint's law, or of its slide's, in words of the family of curves; derived from the law itself."""
    if effect.at not in ("joint", "slide") or effect.acts_on != "torque" or effect.others:
        return None
    if effect.remembers:
        return "distance since it turned by direction"
    reads = _reads(effect)
    if "qdd" in reads:
        return None
    if "load" in reads and not effect.states:
        return "load by direction"
    if "q" in reads:
        return "position by direction" if "qd" in reads else "position"
    return "speed" if _even(effect) else "speed by direction"


@functools.cache
def _even(effect: Effect) -> bool:
    """Is a law of speed the same in both directions?"""
    speed = ca.SX.sym("qd")
    signals = {n: ca.SX(1.0) for n in _SIGNALS} | {"qd": speed} | {n: ca.SX(0.0) for n in effect.states}
    parameters = {p.name: ca.SX(p.grid[len(p.grid) // 2] if p.grid else 1.0) for p in effect.parameters}
    law = ca.Function("law", [speed], [effect.law(signals, parameters)])
    forth, back = float(law(0.7)), float(law(-0.7))
    return abs(forth - back) < 1e-9 * (abs(forth) + abs(back))


_SIGNALS = ("q", "qd", "qdd", "load", "inertia", "time", "temperature", "speed_scale")


@functools.cache
def _reads(effect: Effect) -> set[str]:
    signals = {n: ca.SX.sym(n) for n in _SIGNALS}
    signals |= {n: ca.SX.sym(n) for n in effect.states}
    parameters = {p.name: ca.SX.sym(f"parameter {p.name}") for p in effect.parameters}
    laws = [effect.law(signals, parameters), *(effect.rate(signals, parameters) if effect.rate else ())]
    return {x.name() for law in laws for x in ca.symvar(law)}


def shapes(assembly: TorqueModel) -> NDArray[np.bool_]:
    """Parameters that the torque is not linear in (P,)."""
    shapes = {(p.effect.name, p.at, x.name) for p in assembly.placed for x in p.effect.parameters if x.grid}
    return np.array([(s.effect, s.at, s.name) in shapes for s in assembly.slots], bool)
