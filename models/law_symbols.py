"""What an effect's law reads, and what it gives: its signals by place, and law and rate as symbols."""

from functools import cache
from typing import NamedTuple

import casadi as ca

from .effect import Effect

_JOINT = dict.fromkeys(("q", "qd", "qdd", "load", "inertia", "time", "temperature", "speed_scale"), 1)

#: Signals that a law may read, by place, and how many numbers each has.
SIGNALS = {
    "joint": _JOINT,
    "link": {"phi": 10, "tip": 3},
    "sensor": {"value": 1, **_JOINT},
    "sling": {"velocity": 3, "weight": 1, "tension": 1, "time": 1},
    "slide": _JOINT,
    "boom": {"spread": 2, "time": 1},
    "suspension": {"time": 1},
    "beam": {"moment": 3, "inertia_beyond": 9, "time": 1},
    "base": {"spin": 3, "spin_rate": 3, "acceleration": 3, "spin_gained": 3, "impulse": 3, "time": 1},
    "pin": {"overlap": 1, "approach": 1, "elastic_force": 1, "normal_force": 1, "slip": 3, "slip_velocity": 1},
    "cables": {"bending_stiffness": 1, "curvature_rate": 1},
    "target": {"displacement": 3},
    "carriage": {"qd": 1, "load": 1, "slip_velocity": 1, "time": 1},
    "grooves": {"normal_force": 1, "presliding": 2},
    "groove": {"across": 1},
    "latches": {"drawn": 3, "stiffness": 1, "preload": 1, "since": 1},
}


def signals_of(effect: Effect) -> dict[str, int]:
    """Signals that an effect's law may read, and how many numbers each has."""
    numbers = range(1, len(effect.others) + 1)
    return SIGNALS[effect.at] | {f"{name}_of_{k}": 1 for k in numbers for name in ("q", "qd")}


#: The signal, by place, that itself depends on the model's parameters; none on a suspension rig.
THROUGH = {"joint": "load", "link": "phi", "sensor": "value"}


class LawSymbols(NamedTuple):
    """An effect's parameters p (n_p,), states x (n_x,), signals by name, law (n_out,), and the states' rate (n_x,)."""

    p: ca.SX
    x: ca.SX
    signals: dict[str, ca.SX]
    law: ca.SX
    rate: ca.SX


def symbols(effect: Effect) -> LawSymbols:
    """Law and rate of an effect, as they hang on its symbols."""
    p = ca.SX.sym("p", len(effect.parameters))
    x = ca.SX.sym("x", len(effect.states))
    signals = {name: ca.SX.sym(name, size) for name, size in signals_of(effect).items()}
    states, parameters = named(effect, x, p)
    s = signals | states
    law = ca.vertcat(effect.law(s, parameters))
    return LawSymbols(p, x, signals, law, ca.vertcat(*effect.rate(s, parameters)) if effect.rate else ca.SX(0, 1))


def named(effect: Effect, x: ca.SX, p: ca.SX) -> tuple[dict[str, ca.SX], dict[str, ca.SX]]:
    """States and parameters by name."""
    states = dict(zip(effect.states, ca.vertsplit(x) if effect.states else [], strict=True))
    return states, dict(zip((parameter.name for parameter in effect.parameters), ca.vertsplit(p), strict=True))


@cache
def rows(effect: Effect) -> tuple[int, ...]:
    """Which of the numbers that a law gives can be other than zero."""
    law = symbols(effect).law
    return tuple(i for i in range(law.numel()) if not law[i].is_zero())


@cache
def reads(effect: Effect) -> tuple[str, ...]:
    """Signals that a law, or the rate of its states, depends on."""
    _, _, signals, law, rate = symbols(effect)
    read = ca.vertcat(law, rate)
    return tuple(name for name, u in signals.items() if any(ca.which_depends(read, u, 1, False)))
