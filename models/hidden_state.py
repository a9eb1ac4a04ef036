"""Evaluate an effect along recorded samples: its law, its hidden states, and their derivatives.

Alphabet: n samples, n_x states, n_p parameters, n_out numbers that the law gives; u(t) the recorded signals, linear
between samples. Everything is built once for each effect in CasADi and run over all samples by its virtual machine.

States follow x' = rate(x, u(t), p). One step of length h is ROS2 (Verwer, Spee, Blom and Hundsdorfer, 1999; Hairer and
Wanner, *Solving Ordinary Differential Equations II*, IV.7), second-order and linearly implicit, with the time
dependence of u taken into the linearisation::

    (1 - gamma h J) k1 = h rate(x_n, u_n) + gamma h J_u (u_n+1 - u_n)
    (1 - gamma h J) k2 = h rate(x_n + k1, u_n+1) - 2 k1 - gamma h J_u (u_n+1 - u_n)
    x_n+1 = x_n + 3/2 k1 + 1/2 k2

gamma = 1 - 1/sqrt(2) is the more accurate of the two values for which the method is L-stable: a spring or a delay much
faster than the sampling costs nothing and decays at once. A solution that is linear in time is followed exactly. The
sensitivities dx/dp are the exact derivatives of these steps, carried along in the same pass.
"""

from collections.abc import Mapping
from functools import cache, lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ..errors import InputError
from .effect import Effect

_GAMMA = 1 - np.sqrt(0.5)
_JOINT = dict.fromkeys(("q", "qd", "qdd", "load", "inertia", "time", "temperature", "speed_scale"), 1)

#: Signals that a law may read, by place, and how many numbers each has.
SIGNALS = {"joint": _JOINT, "link": {"phi": 10, "tip": 3}, "sensor": {"value": 1, **_JOINT}}

#: The signal, by place, that itself depends on the model's parameters.
THROUGH = {"joint": "load", "link": "phi", "sensor": "value"}


class _Built(NamedTuple):
    signals: tuple[str, ...]  # those that law and rate read
    law: ca.Function  # (u, x, p) -> value, d/dp, d/dx, d/dthrough
    rate: ca.Function | None  # (u, x, p) -> rate, d/dx, d/dp
    step: ca.Function | None  # ([x; dx/dp], [u0; u1], [p; h]) -> [x; dx/dp] a sample later


class Evaluation(NamedTuple):
    """A law along samples.

    Parameters
    ----------
    values : numpy.ndarray, shape (n_samples, n_out)
        What the law gives.
    by_parameter : numpy.ndarray, shape (n_samples, n_out, n_p)
        Total derivative, hidden states included.
    by_signal : numpy.ndarray, shape (n_samples, n_out, n_signal), or None
        Derivative with respect to ``load`` (joint), ``value`` (sensor) or ``phi`` (link) of the same sample, states
        held; None where the law does not read it. What passes through the states is had by running the change of the
        signal through the law itself: the laws with states that read it, a spring and a delay, are linear in it.
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
        If a signal is missing, or there is no steady state to start from.
    """
    built = _build(effect)
    if built.step is None:
        raise ValueError(f"{effect.name} has no states")
    u = _stack(effect, built.signals, inputs)
    start = _steady_state(effect, built, u[0], np.asarray(parameters, dtype=float))
    n_x, n_p, n = len(effect.states), len(effect.parameters), len(u)
    rows = start[None]
    if n > 1:
        pairs, constants = np.hstack([u[:-1], u[1:]]), np.tile(np.append(parameters, dt), (n - 1, 1))
        (after,) = _run(_accumulate(effect, n - 1), start, pairs, constants)
        rows = np.vstack([start, after.reshape(n - 1, start.size)])
    return rows[:, :n_x], _by_sample(rows[:, n_x:], n, n_x, n_p)


def evaluate_law(
    effect: Effect, inputs: Mapping[str, np.ndarray], parameters: np.ndarray, dt: float | None = None
) -> Evaluation:
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

    Raises
    ------
    InputError
        If a signal is missing, or there is no steady state to start from.
    """
    built = _build(effect)
    u = _stack(effect, built.signals, inputs)
    n, n_p, n_x = len(u), len(effect.parameters), len(effect.states)
    states, sensitivities = np.zeros((n, 0)), None
    if n_x:
        if dt is None:
            raise ValueError(f"{effect.name} has states: dt is needed")
        states, sensitivities = simulate_states(effect, inputs, parameters, dt)
    outputs = _run(_map(effect, n), u, states, np.tile(parameters, (n, 1)))
    n_out, n_signal = built.law.size1_out(0), built.law.size2_out(3)
    by_parameter = _by_sample(outputs[1], n, n_out, n_p)
    if sensitivities is not None:
        by_parameter = by_parameter + _by_sample(outputs[2], n, n_out, n_x) @ sensitivities
    by_signal = _by_sample(outputs[3], n, n_out, n_signal) if n_signal else None
    return Evaluation(outputs[0].reshape(n, n_out), by_parameter, by_signal)


def _run(function: ca.Function, *arguments: np.ndarray) -> list[np.ndarray]:
    """Evaluate on NumPy's own memory: converting to CasADi's matrices and back costs more than most laws.

    CasADi stores by column: a row of an argument is one sample, and so is a stretch of a (flat) result.
    """
    pair: Any = function.buffer()  # CasADi declares another signature than it has
    buffer, evaluate = pair
    held = [np.ascontiguousarray(argument, dtype=float) for argument in arguments]
    results = [np.zeros(function.nnz_out(i)) for i in range(function.n_out())]
    for i, argument in enumerate(held):
        if argument.size:
            buffer.set_arg(i, argument.data)
    for i, result in enumerate(results):
        if result.size:
            buffer.set_res(i, result.data)
    evaluate()
    return results


def _by_sample(stacked: np.ndarray, n: int, rows: int, columns: int) -> np.ndarray:
    """CasADi's matrices, stored by column, as shape (n, rows, columns)."""
    return stacked.reshape(n, columns, rows).transpose(0, 2, 1)


def _stack(effect: Effect, names: tuple[str, ...], inputs: Mapping[str, np.ndarray]) -> np.ndarray:
    """Signals side by side, shape (n_samples, sum of sizes)."""
    missing = [name for name in names if name not in inputs]
    if missing:
        given = ", ".join(inputs) or "none"
        raise InputError(f"{effect.name} reads the signal '{missing[0]}', which is not given (given: {given})")
    return np.column_stack([np.asarray(inputs[name], dtype=float) for name in names])


@cache
def _build(effect: Effect) -> _Built:
    p = ca.SX.sym("p", len(effect.parameters))
    x = ca.SX.sym("x", len(effect.states))
    all_signals = {name: ca.SX.sym(name, size) for name, size in SIGNALS[effect.at].items()}
    named = dict(zip((parameter.name for parameter in effect.parameters), ca.vertsplit(p), strict=True))
    s = all_signals | dict(zip(effect.states, ca.vertsplit(x) if effect.states else [], strict=True))
    law = ca.vertcat(effect.law(s, named))
    rate = ca.vertcat(*effect.rate(s, named)) if effect.rate else ca.SX(0, 1)
    read = ca.vertcat(law, rate)
    names = tuple(name for name, symbol in all_signals.items() if any(ca.which_depends(read, symbol, 1, False)))
    u = ca.vertcat(*(all_signals[name] for name in names))
    through = all_signals[THROUGH[effect.at]]
    if not any(ca.which_depends(law, through, 1, False)):
        through = ca.SX(0, 1)
    outputs = [law, ca.jacobian(law, p), ca.jacobian(law, x), ca.jacobian(law, through)]
    law_function = ca.Function("law", [u, x, p], [ca.densify(output) for output in outputs])
    if not effect.states:
        return _Built(names, law_function, None, None)
    rate_function = ca.Function("rate", [u, x, p], [rate, ca.jacobian(rate, x), ca.jacobian(rate, p)])
    return _Built(names, law_function, rate_function, _step(u, x, p, rate))


def _step(u: ca.SX, x: ca.SX, p: ca.SX, rate: ca.SX) -> ca.Function:
    f = ca.Function("f", [u, x, p], [rate, ca.jacobian(rate, x), ca.jacobian(rate, u)])
    next_u, h, sensitivity = ca.SX.sym("next_u", u.shape), ca.SX.sym("h"), ca.SX.sym("S", x.numel(), p.numel())
    here, by_state, by_input = f(u, x, p)
    matrix = ca.SX.eye(x.numel()) - _GAMMA * h * by_state
    drift = _GAMMA * h * by_input @ (next_u - u)
    k1 = ca.solve(matrix, h * here + drift)
    k2 = ca.solve(matrix, h * f(next_u, x + k1, p)[0] - 2 * k1 - drift)
    next_x = x + 1.5 * k1 + 0.5 * k2
    next_sensitivity = ca.jacobian(next_x, x) @ sensitivity + ca.jacobian(next_x, p)
    return ca.Function(
        "step",
        [ca.vertcat(x, ca.vec(sensitivity)), ca.vertcat(u, next_u), ca.vertcat(p, h)],
        [ca.densify(ca.vertcat(next_x, ca.vec(next_sensitivity)))],
        {"cse": True},
    )


# Held here: CasADi forgets a map that nobody holds, and building it takes as long as running it.
@lru_cache(maxsize=256)
def _map(effect: Effect, n: int) -> ca.Function:
    return _build(effect).law.map(n)


@lru_cache(maxsize=256)
def _accumulate(effect: Effect, n: int) -> ca.Function:
    step = _build(effect).step
    assert step is not None
    return step.mapaccum("steps", n)


def _steady_state(effect: Effect, built: _Built, u: np.ndarray, p: np.ndarray) -> np.ndarray:
    """States with zero rate, by Newton's method from zero, and their sensitivities, stacked as the step wants them."""
    assert built.rate is not None
    x = np.zeros(len(effect.states))
    for _ in range(50):
        rate, by_state, by_parameter = (np.atleast_2d(output.full()) for output in built.rate(u, x, p))
        try:
            change = np.linalg.solve(by_state, -rate[:, 0])
        except np.linalg.LinAlgError:
            break
        x = x + change
        if np.all(np.abs(change) <= 1e-12 * (1e-300 + np.abs(x))) or not np.any(change):
            return np.concatenate([x, np.linalg.solve(by_state, -by_parameter).ravel(order="F")])
    values = ", ".join(f"{a.name} = {b:g} {a.unit}" for a, b in zip(effect.parameters, p, strict=True))
    raise InputError(f"{effect.name} has no steady state to start from at the first sample ({values})")
