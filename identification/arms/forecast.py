"""How well a fitted model of an arm predicts the held-out recordings."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model
from ..decision.selection import Selection
from ..evidence.forecast import Forecast
from ..evidence.forecast import forecast as predicted
from ..fitting.experiment import Experiment, Scales
from ..fitting.fit import Fit
from .weigh import weigh

Array = NDArray[np.float64]


def forecast(
    found: Selection[Any],
    model: Model,
    own: Fit,
    experiments: Sequence[Experiment],
    scales: Mapping[str, Scales],
    residuals: Sequence[Array] | None = None,
) -> Forecast:
    """The held-out recordings under a fit, in the noise and beside the nameless curves of a search; ``residuals`` in
    place of the fit's own, of all recordings.

    What the fit holds at a bound stays there: a law of the wrong sign is not that law."""
    noise = found.weighed
    n = noise.n_train
    weighed = weigh(
        model,
        own,
        experiments,
        found.last.instruments,
        n,
        scales,
        noise.noises,
        runs=noise.runs,
        search=False,
        nameless=found.nameless,
        residuals=residuals,
    )
    # Masses that were learnt would be a name of a mass, at however many deviations; and what laws have wrong, and how
    # a recording starts, is each recording's own.
    count = len(own.theta)
    untold = np.arange(count, weighed.beside.count)
    held = range(n, len(experiments))
    return predicted(weighed, range(n), held, count, fixed=np.flatnonzero(own.at_bound), untold=untold)


def known_to(fit: Fit, told: Forecast) -> Fit:
    """A fit with the deviations that the evidence gives its values: the posterior's second moment about them, C + m m'.

    The posterior has the memory of the noise, sticking, and the tolerances of masses and laws; the fit has none of
    these, and how far its values are from the posterior's mean m is part of how well they are known. What the fit
    cannot determine stays undetermined, and what the evidence holds keeps the fit's deviation.
    """
    covariance = told.covariance + np.outer(told.mean, told.mean)
    held = np.flatnonzero(np.diag(covariance) == 0)
    covariance[np.ix_(held, held)] = fit.covariance[np.ix_(held, held)]
    std = np.where(np.isfinite(fit.std), np.sqrt(np.diag(covariance)), np.inf)
    return replace(fit, covariance=covariance, std=std)


def along_instruments(
    final: Fit, rest: Fit, experiments: Sequence[Experiment], instruments: Sequence[Experiment]
) -> list[Array]:
    """Residuals of the second fit, as far as the instrument motion tells the two apart: those of the first along the
    measured motion, and the difference of the two along the instrument motion.

    A disturbance moves a joint as well as its torque. Along the measured motion, a late sensor or a rotor that is not
    there predicts part of it, in every recording of the same servo (`closed_loop`)."""
    made = []
    for e, i in zip(experiments, instruments, strict=True):
        left, by_rest, by_final = (f.assembly.residual(x, f.theta)[0] for f, x in ((final, e), (rest, i), (final, i)))
        made.append(left + by_rest - by_final)
    return made
