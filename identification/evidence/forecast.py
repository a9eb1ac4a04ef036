"""How well some recordings predict others, every nuisance integrated out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..deciding import TOLERANCES
from .gain import Remaining
from .projected import ProjectedEvidence
from .weighed import WeighedRecordings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Forecast:
    """Log density of the held-out recordings given the training ones, and what is left of each; what the training
    recordings say of the parameters, about their fit: mean (P,) and covariance (P, P).
    """

    density: float
    left: tuple[Remaining, ...]
    mean: Array
    covariance: Array


def forecast(
    weighed: WeighedRecordings,
    train: Sequence[int],
    held: Sequence[int],
    count: int,
    *,
    fixed: Sequence[int] | NDArray[np.int_] = (),
    untold: Sequence[int] | NDArray[np.int_] = (),
) -> Forecast:
    """The held-out recordings as the training recordings predict them, no hypothesis in the model.

    What stands beside is known to the posterior that the training recordings leave, averaged over how exactly the
    masses may be known. With one tolerance, chosen beside a name, the name's removal would leave masses that may not
    move, and nearly every name of a mass would be missed.

    Parameters
    ----------
    weighed : WeighedRecordings
    train, held : sequence of int
        Numbers of the training and of the held-out recordings.
    count : int
        How many of the columns that stand beside are the baseline's parameters.
    fixed : collection of int
        Columns that stay as they were fitted.
    untold : collection of int
        Columns of which the training recordings say nothing: their prior is what is known of them.
    """
    evidence, beside = weighed.evidence, weighed.beside
    several = beside.tolerant.stop > beside.tolerant.start
    new, priors, ons = list(untold), [], []
    for tolerance in (*TOLERANCES, *beside.more) if several else TOLERANCES[:1]:
        weight = beside.weight(tolerance)
        weight[list(fixed)] = 0.0
        own = ProjectedEvidence(evidence, train, weight)
        mean, covariance = own.posterior(evidence.n_always)
        mean[new], covariance[new], covariance[:, new] = 0.0, 0.0, 0.0
        covariance[new, new] = weight[new] ** 2
        priors.append(own.null)
        ons.append((ProjectedEvidence(evidence, held, weight, (mean, covariance)), mean, covariance))
    both = np.array(priors) + [on.null for on, _, _ in ons]
    on, mean, covariance = ons[int(np.argmax(both))]
    always, unit = on.beside([]), beside.spread[:count]
    left = tuple(evidence.left(i, always, []) for i in held)
    density = float(np.logaddexp.reduce(both) - np.logaddexp.reduce(priors))
    return Forecast(density, left, unit * mean[:count], covariance[:count, :count] * np.outer(unit, unit))
