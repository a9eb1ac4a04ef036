"""Lengths of waves to try for a law that repeats over a signal at its place."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.effect import Parameter
from ...models.model import PlacedEffect
from .assembly import TorqueEvaluation, TorqueModel
from .effect_places import TorqueState
from .experiment import Experiment
from .periodogram import Peaks, SampledSignal, peaks, periodogram, trial_waves

Array = NDArray[np.float64]

Weighed = Callable[[int, int], tuple[Array, Callable[[Array, Array], Array]] | None]
"""Of recording i and channel c: K⁻¹ r (n_band,), and the map of cosines and sines to C'K⁻¹C of each pair, as in
`SampledSignal`; None leaves the channel out."""


def wave_peaks(
    assembly: TorqueModel,
    p: PlacedEffect,
    length: Parameter,
    experiments: Sequence[Experiment],
    states: Sequence[TorqueEvaluation],
    weighed: Weighed,
    *,
    lines: bool = False,
) -> Peaks | None:
    """Peaks of a residual's periodogram over the signal that a law repeats over; None where that does not move.

    Parameters
    ----------
    assembly : TorqueModel
    p : PlacedEffect
    length : Parameter
        The wave's length, with the signal in ``periodic_over``.
    experiments, states
        Recordings, and the model without the effect along each.
    weighed : callable
        The residual.
    lines : bool
        Leave out what is no higher than a continuum's peaks.
    """
    place = assembly.at(p)
    signals = [
        place.signals(TorqueState(e, s.load, s.tau))[length.periodic_over]
        for e, s in zip(experiments, states, strict=True)
    ]
    banded = [e.motion.to_band(x) for e, x in zip(experiments, signals, strict=True)]
    waves = trial_waves(banded, *assembly.bounds(p, length))
    if not len(waves):
        return None
    runs = []
    for i, (e, s, signal) in enumerate(zip(experiments, states, signals, strict=True)):
        none = np.zeros((len(signal), 1))
        for c, _, _ in place.spread(e, none, none[:, None]):
            own = weighed(i, c)
            if own is None:
                continue

            def seen(columns: Array, e: Experiment = e, s: TorqueEvaluation = s, c: int = c) -> Array:
                terms = place.spread(e, np.zeros((len(columns), 1)), columns[:, None, :])
                (found,) = (x for at, _, x in terms if at == c)
                for passed in s.passed.get(c, ()):
                    found = passed(found)
                return e.to_band(found, c)

            runs.append(SampledSignal(signal, seen, *own))
    return peaks(waves, periodogram(waves, runs), lines=lines)
