"""The start of a hidden state: a recording may begin while a spring, a tank or a sling still rings.

A law's states start at rest in every run, x' = f(x, u), f(x(0), u(0)) = 0. Where x(0) is another, its torque has the
free response besides, which for a linear law is C exp(A t) (x(0) - x at rest). Each state of each run has one number
more, of which nothing is known but how far the state is from zero as the run goes on: that is its deviation.
"""

import numpy as np
from numpy.typing import NDArray

from ...models.hidden_state import evaluate_law, simulate_states
from ...models.model import PlacedEffect
from ..fitting.assembly import TorqueEvaluation, TorqueModel
from ..fitting.effect_places import TorqueState
from ..fitting.experiment import Experiment

Array = NDArray[np.float64]


def springs_back(p: PlacedEffect) -> bool:
    """Whether a law has states that return to rest by themselves: no delay, no heat, no bristle that stays bent."""
    effect = p.effect
    return bool(effect.states) and not effect.from_zero and not effect.remembers and effect.at != "sensor"


def free_responses(
    assembly: TorqueModel, experiment: Experiment, state: TorqueEvaluation, p: PlacedEffect, parameters: Array
) -> list[tuple[int, Array]]:
    """What each channel feels of every state of every run that starts off rest.

    Parameters
    ----------
    assembly : TorqueModel
    experiment : Experiment
    state : TorqueEvaluation
        Of the model along ``experiment``.
    p : PlacedEffect
        One that `springs_back`, in the model or not.
    parameters : array (p,)
        Of its law.

    Returns
    -------
    list of (channel, columns)
        Columns (n_band, k) [N·m or N] in units of their prior deviation, the same k for every channel.
    """
    place, effect, period = assembly.at(p), p.effect, experiment.motion.period
    signals = place.signals(TorqueState(experiment, state.load, state.tau))
    found: dict[int, list[Array]] = {}
    for segment in experiment.motion.segments:
        inputs = {name: x[segment] for name, x in signals.items()}
        rest = evaluate_law(effect, inputs, parameters, period, bare=True).values
        away = np.sqrt(np.mean(simulate_states(effect, inputs, parameters, period)[0] ** 2, axis=0))
        for k in np.flatnonzero(away > 0):
            start = np.where(np.arange(len(away)) == k, away, 0.0)
            free = evaluate_law(effect, inputs, parameters, period, bare=True, start=start).values - rest
            values = np.zeros((len(experiment.motion.q), free.shape[1]))
            values[segment] = free
            for c, torque, _ in place.spread(experiment, values, np.zeros((*values.shape, 0))):
                column = torque[:, None]
                for passed in state.passed.get(c, ()):
                    column = passed(column)
                found.setdefault(c, []).append(experiment.to_band(column, c))
    return [(c, np.hstack(own)) for c, own in found.items()]
