"""An effect's law along a recording: hidden states start at rest in every run, and a sensor passes columns on."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from ...models.effect import Effect
from ...models.hidden_state import LawEvaluation, evaluate_law
from .experiment import Experiment

Array = NDArray[np.float64]

RESPONSE = 512
"""Samples of a sensor's impulse response that are kept; a delay of 0.2 s at 1 kHz rings out well inside it."""

FORWARD, BACKWARD = slice(None), slice(None, None, -1)
"""Directions of time."""


def law_along(
    experiment: Experiment,
    effect: Effect,
    signals: Mapping[str, Array],
    parameters: Array,
    bare: bool = False,
    direction: slice = FORWARD,
) -> LawEvaluation:
    """The law over all n samples; one with hidden states starts afresh, at rest, in every segment of the recording.

    Parameters
    ----------
    experiment : Experiment
    effect : Effect
    signals : mapping of str to array (n,) or (n, size)
        What the law reads; it leaves the others.
    parameters : array (p,)
    bare : bool
        Leave out the derivative by the parameters of an effect with hidden states: (n, m, 0).
    direction : slice
        `FORWARD`, or `BACKWARD` for states that follow time in reverse.
    """
    period = experiment.motion.period
    if not effect.states:
        return evaluate_law(effect, signals, parameters, period)
    parts = []
    for segment in experiment.motion.segments:
        inputs = {name: x[segment][direction] for name, x in signals.items()}
        found = evaluate_law(effect, inputs, parameters, period, bare=bare)
        parts.append([x[direction] for x in found if x is not None])
    values, by_parameter, *by_signal = (np.concatenate(x) for x in zip(*parts, strict=True))
    return LawEvaluation(values, by_parameter, by_signal[0] if by_signal else None)


def passing(
    experiment: Experiment, effect: Effect, parameters: Array, by_value: Array | None, direction: slice
) -> Callable[[Array], Array]:
    """The map of columns (n, k) through a sensor: a gain, or its impulse response.

    ``by_value`` (n, 1, 1) is the derivative of a stateless sensor's law by the true value; None: a derivative of one.
    """
    segments = experiment.motion.segments
    if effect.states:
        response = impulse_response(effect, parameters, experiment.motion.period)
        return lambda columns: np.concatenate([causal(columns[s][direction], response)[direction] for s in segments])
    gain = np.ones(1) if by_value is None else by_value[:, 0, 0]
    return lambda columns: gain[:, None] * columns


def impulse_response(effect: Effect, parameters: Array, period: float) -> Array:
    """Reading of a linear sensor for a unit impulse (m,), from the law itself; ``period`` in seconds."""
    impulse = np.zeros(RESPONSE)
    impulse[1] = 1.0
    response = evaluate_law(effect, {"value": impulse}, parameters, period, bare=True).values[1:, 0]
    last = np.flatnonzero(np.abs(response) > 1e-9)
    return response[: last[-1] + 1] if len(last) else response[:1]


def causal(columns: Array, response: Array) -> Array:
    """Columns (n, k) through a causal filter (m,), with the first row as its whole past."""
    count, before = len(columns), len(response) - 1
    seen = np.empty((columns.shape[1], before + count))
    seen[:, :before], seen[:, before:] = columns[:1].T, columns.T
    size = next_fast_len(before + count, real=True)  # what comes round the circle ends in the lead
    spectrum = np.fft.rfft(seen, size) * np.fft.rfft(response, size)
    return np.fft.irfft(spectrum, size)[:, before : before + count].T
