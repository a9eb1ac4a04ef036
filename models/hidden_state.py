"""Evaluate an effect along recorded samples: its law, its hidden states, and their derivatives.

Alphabet: n samples, n_x states, n_p parameters, n_out numbers that the law gives; u(t) the recorded signals, linear
between samples. Law and step are written once for each effect, in CasADi, and run over all samples in C.

States follow x' = rate(x, u(t), p), by a step of `ros2` a sample. Where an effect gives the exact solution over a
sample (``Effect.advance``), that takes the place of the step. The sensitivities dx/dp are the exact derivatives of
these steps, carried along in the same pass.
"""

import os
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from ..errors import InputError
from .compiled import SampleFunction
from .effect import Effect
from .ros2 import ros2
from .steady_state import steady_state

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


class _Built(NamedTuple):
    """X = [x; dx/dp by rows] is what a sample hands to the next."""

    signals: tuple[str, ...]  # those that law and rate read
    law: SampleFunction  # (*signals, X, p) -> value, total d/dp unless bare, and d/dthrough if any
    rate: SampleFunction | None  # (*signals, x, p) -> rate, d/dx, d/dp
    step: SampleFunction | None  # (X, *signals, *signals a sample later, [p; h]) -> X a sample later


class LawEvaluation(NamedTuple):
    """A law along samples.

    Parameters
    ----------
    values : numpy.ndarray, shape (n_samples, n_out)
        What the law gives.
    by_parameter : numpy.ndarray, shape (n_samples, n_out, n_p)
        Total derivative, hidden states included.
    by_signal : numpy.ndarray, shape (n_samples, n_out, n_signal), or None
        Derivative with respect to ``load`` (joint), ``value`` (sensor) or ``phi`` (link) of the same sample; None where
        the law does not read it. States of a joint's torque follow as they would at rest, those of the others are held:
        what passes through these is had by running the change of the signal through the law itself, since a spring and
        a delay are linear in it.
    """

    values: np.ndarray
    by_parameter: np.ndarray
    by_signal: np.ndarray | None


def simulate_states(
    effect: Effect, inputs: Mapping[str, np.ndarray], parameters: np.ndarray, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Hidden states of an effect along evenly spaced samples, from rest at the first sample's inputs.

    Parameters
    ----------
    effect : Effect
        One with states.
    inputs : mapping of str to numpy.ndarray, shape (n_samples,) or (n_samples, size)
        The signals it reads; others are ignored.
    parameters : numpy.ndarray, shape (n_p,)
        In the effect's order, absolute values in SI units.
    dt : float
        Time between samples [s].

    Returns
    -------
    states : numpy.ndarray, shape (n_samples, n_x)
    sensitivities : numpy.ndarray, shape (n_samples, n_x, n_p)

    Raises
    ------
    InputError
        If a signal is missing or does not fit the others, or there is no steady state to start from.
    """
    built = _build(effect, False)
    p = np.asarray(parameters, dtype=float)
    rows = _carried(effect, built, _signals(effect, built, inputs), p, dt)
    n_x = len(effect.states)
    return rows[:, :n_x], rows[:, n_x:].reshape(len(rows), n_x, len(p))


def evaluate_law(
    effect: Effect,
    inputs: Mapping[str, np.ndarray],
    parameters: np.ndarray,
    dt: float | None = None,
    *,
    bare: bool = False,
    start: np.ndarray | None = None,
) -> LawEvaluation:
    """Values of an effect's law along samples, with derivatives.

    Parameters
    ----------
    effect : Effect
        With states or without.
    inputs : mapping of str to numpy.ndarray, shape (n_samples,) or (n_samples, size)
        The signals it reads; others are ignored.
    parameters : numpy.ndarray, shape (n_p,)
        In the effect's order, absolute values in SI units.
    dt : float, optional
        Time between samples [s]; an effect with states needs it.
    bare : bool
        Of an effect with states, leave out the derivatives by its parameters, which take most of the time:
        ``by_parameter`` has no columns then.
    start : numpy.ndarray, shape (n_x,), optional
        How far from its steady state each state is at the first sample; their derivatives are not changed.

    Notes
    -----
    Play without damping rattles on, and may do so chaotically: neighbouring motions part exponentially. Where the
    rounding of a parameter would move the law by more than its own size, the derivatives by parameters are zero: the
    samples say nothing of them.

    Raises
    ------
    InputError
        If a signal is missing or does not fit the others, or there is no steady state to start from.
    """
    bare = bare and bool(effect.states)
    built = _build(effect, bare)
    signals, p = _signals(effect, built, inputs), np.asarray(parameters, dtype=float)
    carried = np.zeros(0)
    if effect.states:
        if dt is None:
            raise ValueError(f"{effect.name} has states: dt is needed")
        carried = _carried(effect, built, signals, p, dt, bare, start)
    if not built.signals:  # a constant reads nothing that says how many samples there are
        p = np.tile(p, (len(next(iter(inputs.values()))), 1))
    values, *slopes = built.law(*signals, carried, p)
    by_parameter = np.zeros((*values.shape[:2], 0)) if bare else slopes.pop(0)
    if effect.states and by_parameter.size and _chaotic(values, by_parameter, p):
        by_parameter = np.zeros_like(by_parameter)
    return LawEvaluation(values[:, :, 0], by_parameter, slopes[0] if slopes else None)


def _chaotic(values: np.ndarray, by_parameter: np.ndarray, p: np.ndarray) -> bool:
    """Whether a parameter's rounding alone moves the law by more than its own size."""
    moved = np.abs(by_parameter).max(axis=(0, 1)) * np.abs(p)
    return bool(np.finfo(float).eps * moved.max() > np.abs(values).max())


@cache
def rows(effect: Effect) -> tuple[int, ...]:
    """Which of the numbers that a law gives can be other than zero."""
    law = _symbols(effect).law
    return tuple(i for i in range(law.numel()) if not law[i].is_zero())


@cache
def reads(effect: Effect) -> tuple[str, ...]:
    """Signals that a law, or the rate of its states, depends on."""
    _, _, signals, law, rate = _symbols(effect)
    read = ca.vertcat(law, rate)
    return tuple(name for name, u in signals.items() if any(ca.which_depends(read, u, 1, False)))


def prepare(effects: Iterable[Effect]) -> None:
    """Compile effects ahead of their first use, several at a time; what is in the cache already costs milliseconds.

    Those with states in both forms, with derivatives and bare.
    """
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(_build, *zip(*((e, bare) for e in effects for bare in {False, bool(e.states)}), strict=True)))


def _signals(effect: Effect, built: _Built, inputs: Mapping[str, np.ndarray]) -> list[np.ndarray]:
    """What law and rate read, each of shape (n_samples, size)."""
    missing = [name for name in built.signals if name not in inputs]
    if missing:
        given = ", ".join(inputs) or "none"
        raise InputError(f"{effect.name} reads the signal '{missing[0]}', which is not given (given: {given})")
    arrays = [np.asarray(inputs[name], dtype=float) for name in built.signals]
    return [array[:, None] if array.ndim == 1 else array for array in arrays]


def _carried(
    effect: Effect,
    built: _Built,
    signals: list[np.ndarray],
    p: np.ndarray,
    dt: float,
    bare: bool = False,
    away: np.ndarray | None = None,
) -> np.ndarray:
    """States and, unless bare, sensitivities, stacked as the step hands them on (n_samples, n_x + n_x * n_p)."""
    if built.step is None:
        raise ValueError(f"{effect.name} has no states")
    count = len(effect.states) * (1 if bare else 1 + len(p))
    if effect.from_zero:
        start = np.zeros(count)
    else:
        start = _at_rest(effect, built, [signal[:1] for signal in signals], p)[:count]
    if away is not None:
        start[: len(effect.states)] += away
    here, later = [signal[:-1] for signal in signals], [signal[1:] for signal in signals]
    return built.step.scan(start, *here, *later, np.append(p, dt))


def _at_rest(effect: Effect, built: _Built, first: list[np.ndarray], p: np.ndarray) -> np.ndarray:
    """States with zero rate at the first sample, and their sensitivities, stacked as the step wants them."""
    evaluate = built.rate
    assert evaluate is not None
    found = steady_state(lambda x: [output[0] for output in evaluate(*first, x, p)], len(effect.states))
    if found is None:
        values = ", ".join(f"{a.name} = {b:g} {a.unit}" for a, b in zip(effect.parameters, p, strict=True))
        raise InputError(f"{effect.name} has no steady state to start from at the first sample ({values})")
    return np.concatenate([found[0], found[1].ravel()])


class _Symbols(NamedTuple):
    p: ca.SX
    x: ca.SX
    signals: dict[str, ca.SX]
    law: ca.SX
    rate: ca.SX


def _symbols(effect: Effect) -> _Symbols:
    p = ca.SX.sym("p", len(effect.parameters))
    x = ca.SX.sym("x", len(effect.states))
    signals = {name: ca.SX.sym(name, size) for name, size in signals_of(effect).items()}
    states, named = _named(effect, x, p)
    s = signals | states
    law = ca.vertcat(effect.law(s, named))
    return _Symbols(p, x, signals, law, ca.vertcat(*effect.rate(s, named)) if effect.rate else ca.SX(0, 1))


def _named(effect: Effect, x: ca.SX, p: ca.SX) -> tuple[dict[str, ca.SX], dict[str, ca.SX]]:
    """States and parameters by name."""
    states = dict(zip(effect.states, ca.vertsplit(x) if effect.states else [], strict=True))
    return states, dict(zip((parameter.name for parameter in effect.parameters), ca.vertsplit(p), strict=True))


@cache
def _build(effect: Effect, bare: bool) -> _Built:
    p, x, all_signals, law, rate = _symbols(effect)
    sensitivity = ca.SX.sym("S", x.numel(), 0 if bare else p.numel())
    signals = {name: all_signals[name] for name in reads(effect)}
    names, u = tuple(signals), list(signals.values())
    through = all_signals.get(THROUGH.get(effect.at, ""))
    outputs = [law] if bare else [law, ca.jacobian(law, p) + ca.jacobian(law, x) @ sensitivity]
    if through is not None and any(ca.which_depends(law, through, 1, False)):
        by_signal = ca.jacobian(law, through)
        follow = x.numel() and any(ca.which_depends(rate, through, 1, False))
        if effect.at == "joint" and effect.acts_on == "torque" and follow:
            by_signal -= ca.jacobian(law, x) @ ca.solve(ca.jacobian(rate, x), ca.jacobian(rate, through))
        outputs.append(by_signal)
    law_function = _compiled(effect, "law", [*u, _stacked(x, sensitivity), p], outputs, [*names, "states", "p"])
    if not effect.states:
        return _Built(names, law_function, None, None)
    outputs = [rate, ca.jacobian(rate, x), ca.jacobian(rate, p)]
    rate_function = _compiled(effect, "rate", [*u, x, p], outputs, [*names, "states", "p"])
    return _Built(names, law_function, rate_function, _step(effect, signals, x, p, sensitivity, rate))


def _step(
    effect: Effect, signals: Mapping[str, ca.SX], x: ca.SX, p: ca.SX, sensitivity: ca.SX, rate: ca.SX
) -> SampleFunction:
    u = ca.vertcat(*signals.values())
    later = {f"next_{name}": ca.SX.sym(f"next_{name}", symbol.shape) for name, symbol in signals.items()}
    next_u, h = ca.vertcat(*later.values()), ca.SX.sym("h")
    if effect.advance:
        states, named = _named(effect, x, p)
        next_signals = dict(zip(signals, later.values(), strict=True))
        next_x = ca.vertcat(*effect.advance({**signals, **states}, next_signals, named, h))
    else:
        f = ca.Function("f", [x, u, p], [rate, ca.jacobian(rate, x), ca.jacobian(rate, u)])
        next_x = ros2(lambda state, read: f(state, read, p), x, u, next_u, h)
    next_sensitivity = sensitivity  # of no columns: bare
    if sensitivity.numel():
        next_sensitivity = ca.jacobian(next_x, x) @ sensitivity + ca.jacobian(next_x, p)
    inputs = [_stacked(x, sensitivity), *signals.values(), *later.values(), ca.vertcat(p, h)]
    names = ["states", *signals, *later, "p_and_h"]
    return _compiled(effect, "step", inputs, [_stacked(next_x, next_sensitivity)], names)


def _stacked(x: ca.SX, sensitivity: ca.SX) -> ca.SX:
    return ca.vertcat(x, ca.vec(sensitivity.T))


def _compiled(effect: Effect, what: str, inputs: list[ca.SX], outputs: list[ca.SX], names: list[str]) -> SampleFunction:
    results = [f"out{i}" for i in range(len(outputs))]
    # A link's law runs on one sample, a step from one to the next; the others on thousands side by side.
    lanes = what == "law" and effect.at != "link"
    return SampleFunction(ca.Function(f"{effect.name}_{what}", inputs, ca.cse(outputs), names, results), lanes=lanes)
