"""Confirm on the held-out recordings the names of a search, by the evidence of the search.

With an effect and without it the rest is fitted again, and both models predict the held-out recordings: the log density
of these given the training recordings (Dawid 1984), every nuisance integrated out anew. The nameless curves that the
search ended with stand beside both, so that a name which only imitates one of them shows no loss. A name stays if that
density falls without it by more than the scatter over blocks of time, and if the loss is larger than any model's own
error.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model
from ..deciding import BLOCK, DISCREPANCY, GATE
from ..fitting.experiment import Experiment, Scales
from ..fitting.fit import Fit, channel_rms
from ..search.refit import without
from .arm import weigh
from .gain import Remaining, scatter
from .nearly import without_its_curves
from .projected import ProjectedEvidence
from .selection import ArmNaming, ArmSelection

Array = NDArray[np.float64]

FEWEST_BLOCKS = 4


@dataclass(frozen=True)
class PredictiveDensity:
    """Log density of the held-out recordings given the training ones, and what is left of each; what the training
    recordings say of the parameters, about their fit: mean (P,) and covariance (P, P).
    """

    density: float
    left: tuple[Remaining, ...]
    mean: Array
    covariance: Array


@dataclass(frozen=True)
class ArmLoss:
    """What the held-out recordings lose without an effect: log density and its scatter; the difference of the two
    models' torques [RMS, share of the channel's]; relative errors with and without it; the share of the residual's
    energy that it explains, 0 to 1; and the fit without it.
    """

    gain: float
    scatter: float
    size: float
    trial: tuple[float, float]
    explained: float
    fit: Fit

    @property
    def sure(self) -> float:
        """The loss in units of its scatter."""
        return self.gain / max(self.scatter, 1e-12)

    @property
    def told(self) -> bool:
        """Whether the loss is beyond its scatter, and larger than any model's own error."""
        return self.sure > GATE and self.size >= DISCREPANCY


@dataclass(frozen=True)
class ArmConfirmation:
    """The names that the held-out recordings confirmed, the rejected ones, the loss of each, and the fit of the
    confirmed model.

    A name whose loss is beyond its scatter, but smaller than any model's own error, is neither."""

    found: ArmSelection
    names: tuple[ArmNaming, ...]
    rejected: tuple[ArmNaming, ...]
    weak: Mapping[str, ArmLoss]
    """What the held-out recordings miss of the rejected."""
    missed: Mapping[str, ArmLoss]
    model: Model
    fit: Fit
    forecast: PredictiveDensity


def confirm(
    found: ArmSelection,
    train: Sequence[Experiment],
    held: Sequence[Experiment],
    scales: Mapping[str, Scales],
    progress: Callable[[str], None],
) -> ArmConfirmation:
    """Remove the name with the smallest held-out loss and fit all else again, until every name's loss is beyond its
    scatter.

    Names are removed one at a time: of two that replace each other, one stays, and its loss is larger from then on. So
    the others are tried again in the order of their last loss, and only until one is to be removed. Of a law and its
    special case, neither of which is missed, the law goes first (the principle of marginality: Nelder 1977).
    """
    progress("confirming on the held-out recordings")
    model, final = found.model, found.fit
    whole = forecast(model, final, found, train, held, scales)
    left = {n.placed.key: n for n in found.names}
    missed: dict[str, ArmLoss] = {}
    rejected: list[ArmNaming] = []
    weak: dict[str, ArmLoss] = {}
    stale = set(left)
    while stale:
        # What was never tried, then what was missed least.
        key = min(stale, key=lambda k: missed[k].sure if k in missed else -np.inf)
        stale.remove(key)
        missed[key] = _missed(left[key], model, final, whole, found, train, held, scales)
        if any(k not in missed for k in left):
            continue
        out = {k for k in left if not missed[k].told}
        special = {f"{part}.{left[k].placed.at}" for k in out for part in left[k].placed.effect.contains}
        weakest = min(left, key=lambda k: (k not in out, k in special, missed[k].sure))
        if not missed[weakest].told and weakest not in stale:
            removed, gone = left.pop(weakest), missed.pop(weakest)
            final = gone.fit
            if gone.sure <= GATE:
                rejected.append(removed)
                weak[weakest] = gone
            model = _without(model, weakest)
            whole = forecast(model, final, found, train, held, scales)
            stale = set(left)
            progress(
                f"confirming on the held-out recordings: {removed.placed.key} is not confirmed, {len(left)} names left"
            )
    names = tuple(sorted(left.values(), key=lambda n: -missed[n.placed.key].size))
    # A nameless curve is what the names leave: their values do not wait for it.
    told = forecast(model, final, replace(found, slots=()), train, held, scales) if found.nameless else whole
    return ArmConfirmation(found, names, tuple(rejected), weak, missed, model, known_to(final, told), whole)


def forecast(
    model: Model,
    own: Fit,
    found: ArmSelection,
    train: Sequence[Experiment],
    held: Sequence[Experiment],
    scales: Mapping[str, Scales],
    residuals: Sequence[Array] | None = None,
) -> PredictiveDensity:
    """How well a fitted model predicts the held-out recordings; ``residuals`` in place of the fit's own, of all.

    What the fit holds at a bound stays there: a law of the wrong sign is not that law."""
    n = len(train)
    noise = found.weighed
    weighed = weigh(
        model,
        own,
        [*train, *held],
        found.instruments,
        n,
        scales,
        noise.noises,
        runs=noise.runs,
        search=False,
        nameless=found.nameless,
        residuals=residuals,
    )
    weight = weighed.beside.weight(found.tolerance)
    weight[: len(own.theta)][own.at_bound] = 0.0
    fitted_by = ProjectedEvidence(weighed.evidence, range(n), weight)
    mean, covariance = known = fitted_by.posterior(len(own.theta))
    unit = weighed.beside.spread
    on = ProjectedEvidence(weighed.evidence, range(n, n + len(held)), weight, known)
    always = on.beside([])
    left = tuple(weighed.evidence.left(n + i, always, []) for i in range(len(held)))
    return PredictiveDensity(on.null, left, unit * mean, covariance * np.outer(unit, unit))


def known_to(fit: Fit, told: PredictiveDensity) -> Fit:
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


def blocks(e: Experiment, x: Array) -> Array:
    """Sums over blocks of time."""
    return np.array(
        [part.sum() for part in np.array_split(x, max(int(len(x) / (2 * e.motion.band) / BLOCK), FEWEST_BLOCKS))]
    )


def _without(model: Model, key: str) -> Model:
    return replace(model, effects=tuple(p for p in model.effects if p.key != key))


def _missed(
    name: ArmNaming,
    model: Model,
    final: Fit,
    whole: PredictiveDensity,
    found: ArmSelection,
    train: Sequence[Experiment],
    held: Sequence[Experiment],
    scales: Mapping[str, Scales],
) -> ArmLoss:
    """Take one effect out of a fit, and fit the rest again."""
    key = name.placed.key
    rest = without(final, [key], train, found.first)
    beside = without_its_curves(found, name.channels, final, rest, train)
    whole = whole if beside is found else forecast(model, final, beside, train, held, scales)
    residuals = along_instruments(final, rest, [*train, *held], found.instruments)
    other = forecast(_without(model, key), rest, beside, train, held, scales, residuals)
    c = list(name.channels)
    with_it, measured = channel_rms(final.assembly, held, final.theta)
    rms, _ = channel_rms(rest.assembly, held, rest.theta)
    apart = _apart(final, rest, held)
    worst = c[int(np.argmax(apart[c] / measured[c]))]
    trial = float(with_it[worst] / measured[worst]), float(rms[worst] / measured[worst])
    size = float(apart[worst] / measured[worst])
    gain = whole.density - other.density
    explained = _explained(found, final, rest, held, worst)
    error = scatter(other.left, whole.left, [partial(blocks, e) for e in held])
    return ArmLoss(gain, error, size, trial, explained, rest)


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


def _explained(found: ArmSelection, final: Fit, rest: Fit, held: Sequence[Experiment], c: int) -> float:
    """Share of a channel's residual energy that goes with an effect, every sample by its own variance: near rest, where
    a joint holds any torque, little counts. A wander counts as residual: a law without a name may look like it."""
    n, sums = found.weighed.n_train, np.zeros(2)
    for e, row in zip(held, found.weighed.evidence.channels[n:], strict=True):
        both = [f.assembly.residual(e, f.theta)[0][:, c] for f in (final, rest)]
        sums += [float(np.sum(x**2 / row[c].covariance.variance)) for x in both]
    return float(np.clip(1 - sums[0] / sums[1], 0.0, 1.0)) if sums[1] > 0 else 0.0


def _apart(one: Fit, other: Fit, held: Sequence[Experiment]) -> Array:
    """RMS difference of two models' torques on some recordings, in the analysis band (J,)."""
    torques = [[e.all_to_band(x.assembly.torque(e, x.theta)) for e in held] for x in (one, other)]
    counted = np.maximum(np.sum([e.counted for e in held], axis=0), 1)
    return np.sqrt(np.sum((np.concatenate(torques[0]) - np.concatenate(torques[1])) ** 2, axis=0) / counted)
