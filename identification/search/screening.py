"""One screening: every effect at every place and shape judged on top of a fit, and the noise they are judged
against."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model
from ..diagnosis import Limit
from ..fitting.assembly import Assembly, Block, Evaluation
from ..fitting.experiment import Experiment
from ..fitting.fit import Fit
from ..fitting.problem import gather
from .candidates import Variant, candidate_columns, free_parameters, library, nameless_columns, smooth_columns, variants
from .encoder_noise import encoder_torque
from .evidence import Channel, Evidence
from .judged import Case, Judged, Parts, Samples
from .rest import bridged, friction_less, in_motion
from .saturated import Noise, learn

Array = NDArray[np.float64]

RAW_BLOCKS = 12
"""Blocks of unwhitened samples, each predicted from the others."""

WORTH = 0.05
"""Least share of its channels' residual energy that an effect must explain to be named."""

MOST = 0.5
"""Share of its channels' residual energy, near rest too, from which on an effect with a memory of where the joint
turned is named for what it does near rest: joints that stick and rounded signs look like one, and leave most of it."""

DRIVEN_MOST = 0.25
"""Share of its own channel's residual energy from which on a drive's spring or play is named for what it explains along
the motion as measured, which knows how the link rings: what disturbances drive looks like one too, and leaves most."""

TUNINGS = 3
"""Rounds in which the shape of such a candidate is tuned; what rings falls between the points of a grid."""

NULLS = 200

LEVEL = 0.995
"""Quantile of the best score on noise that a candidate must beat, among all that reach the same channels."""


@dataclass(frozen=True)
class Screening:
    """Candidates best first, the score that noise alone reaches on each set of channels, and what nameless curves
    explain."""

    evidence: Evidence
    near_rest: Samples
    """Samples near rest too, on which some of the candidates were judged."""
    measured: Samples
    """Samples in motion beside a baseline from the motion as measured, on which some of the candidates were judged."""
    judged: tuple[Judged, ...]
    asked: Mapping[str, Judged]
    """Of drives judged along the motion as measured: the same along the motion that was asked for."""
    threshold: Mapping[tuple[int, ...], float]
    nameless: Mapping[int, float]
    over: Mapping[int, str]
    """What the nameless curves run over, in words."""
    limits: tuple[Limit, ...]
    noise: Noise


def screen(
    model: Model,
    found: Fit,
    experiments: Sequence[Experiment],
    instruments: Sequence[Experiment],
    noise: Noise | None,
    seed: int,
) -> Screening:
    """Judge every candidate on top of a fit.

    Parameters
    ----------
    model : Model
        With the effects of the fit.
    found : Fit
    experiments : sequence of Experiment
        Training recordings: their residuals are explained.
    instruments : sequence of Experiment
        The same with the motion that was asked for: columns come from these, so that no disturbance stands in them.
    noise : Noise or None
        From the first screening; None learns it.
    seed : int
        Of the sign-flipped nulls.
    """
    assembly = found.assembly
    moving, planned = [bridged(e) for e in experiments], [bridged(z) for z in instruments]
    states, exact = ([assembly.evaluate(e, found.theta) for e in some] for some in (instruments, experiments))
    residuals, baseline = _left(found, moving, planned)
    pool = []
    for p in library(model):
        # Friction that sticks shows in the smallest motion only: a low-passed one has lost it.
        source = (moving, exact) if p.effect.at_rest else (planned, states)
        pool.append([(v, _columns(found, *source, v)) for v in variants(assembly, p)])
    smooth = [[smooth_columns(e, s, c) for e, s in zip(planned, states, strict=True)] for c in range(len(model.joints))]
    if noise is None:
        noise = learn(moving, residuals, _saturated(baseline, pool, smooth))
    samples = _samples(found, baseline, residuals, noise, in_motion(experiments), {}, seed)
    # Columns from the motion as measured are judged beside a baseline from the same.
    close = _samples(found, _left(found, moving, moving)[1], residuals, noise, in_motion(experiments), {}, seed)
    # Friction above its level near rest is evidence, too: whatever sticks there stays below it.
    held = {c: [friction_less(e, c) for e in experiments] for c in range(len(model.joints))}
    residuals, baseline = _left(found, experiments, experiments)
    near_rest = _samples(found, baseline, residuals, noise, None, held, seed)
    noisy = np.mean([encoder_torque(found, e) ** 2 for e in experiments], axis=0)
    energy = [float(np.mean((c.residual * s) ** 2)) for c, s in zip(close.raw.channels, found.sigma, strict=True)]
    heard = noisy / np.maximum(energy, 1e-300)
    log_size = np.log(samples.evidence.size)
    judged: list[Judged] = []
    asked: dict[str, Judged] = {}
    null: dict[tuple[int, ...], Array] = {(c,): np.zeros(NULLS) for c in range(len(model.joints))}

    def beyond_noise(j: Judged, some: Samples, source: Sequence[Experiment], states: Sequence[Evaluation]) -> float:
        """Share of its joint's own residual that a drive explains, less what the encoders' noise accounts for."""
        own = assembly.joint_of(j.placed)
        return some.explained(j.variant, {own: _columns(found, source, states, j.variant)[own]}) - heard[own]

    for options in pool:

        def price(variant: Variant) -> float:
            return 0.5 * log_size * len(free_parameters(assembly, instruments[0], states[0], variant))

        def everywhere(variant: Variant) -> dict[int, Parts]:
            return _columns(found, experiments, exact, variant)

        effect = options[0][0].placed.effect
        plain = _judge(close if effect.at_rest else samples, noise, options, price, null, everywhere)
        others: list[Judged | None] = []
        measured = [(v, everywhere(v)) for v, _ in options] if effect.exceeds_at_rest or effect.remembers else []
        if effect.acts_on == "position":
            if plain is not None and beyond_noise(plain, samples, planned, states) < WORTH:
                plain = None

            def driven(some: Sequence[Variant]) -> Judged | None:
                measured = [(v, _columns(found, moving, exact, v)) for v in some]
                return _judge(close, noise, measured, price, None, everywhere)

            j = _tuned(driven([v for v, _ in options]), driven)
            if j is not None and beyond_noise(j, close, moving, exact) > DRIVEN_MOST:
                if plain is not None:
                    asked[plain.placed.key] = plain
                others.append(j)
        if effect.exceeds_at_rest:
            others.append(_judge(near_rest, noise, measured, price, None, everywhere))
        if effect.remembers:
            j = _judge(near_rest.alone(), noise, measured, price, None, everywhere)
            others += [j] if j is not None and j.explained > MOST else []
        if effect.at_rest and plain is not None and plain.case.share() > WORTH:
            # What is plain in motion may be worth its name for what it does near rest.
            whole = near_rest.alone().explained(plain.variant, everywhere(plain.variant))
            plain = replace(plain, explained=max(plain.explained, whole))
        better = max((j for j in (plain, *others) if j is not None), key=lambda j: j.score, default=None)
        if better is not None:
            free = free_parameters(assembly, instruments[0], states[0], better.variant)
            hold = tuple(p.name for p in better.placed.effect.parameters if p.name not in free)
            judged.append(replace(better, placed=replace(better.placed, hold=hold)))
    threshold = {channels: float(np.quantile(x, LEVEL)) for channels, x in null.items()}
    limits = [
        limit for j in judged for limit in _limits(assembly, samples.evidence, j, threshold[j.channels] + j.price)
    ]
    nameless: dict[int, float] = {}
    over: dict[int, str] = {}
    for c in range(len(model.joints)):
        curves = [nameless_columns(e, s, c) for e, s in zip(planned, states, strict=True)]
        for words in curves[0]:
            parts = [x[words] for x in curves]
            free = np.full(parts[0].shape[1], np.inf)
            variant = replace(pool[0][0][0], low=-free, high=free)
            case = samples.case(variant, {c: parts})
            score = case.gain().total - 0.5 * len(free) * log_size
            spread = float(found.sigma[c])  # a curve is no taller than what is left over, before it is seen
            if score > threshold[(c,)] and reliably_positive(case.fresh_gains(spread)):
                share = min(samples.foreseen(variant, {c: parts}, spread), 1.0)
                if share > nameless.get(c, 0.0):
                    nameless[c], over[c] = share, words
    judged.sort(key=lambda j: -j.score)
    return Screening(
        samples.evidence, near_rest, close, tuple(judged), asked, threshold, nameless, over, tuple(limits), noise
    )


def _left(
    found: Fit, experiments: Sequence[Experiment], instruments: Sequence[Experiment]
) -> tuple[list[Array], list[list[tuple[NDArray[np.int_], Array]]]]:
    """Residual of every recording (n_band, J), and the baseline's columns from the motion that was asked for."""
    assembly = found.assembly
    pairs = [
        (assembly.residual(e, found.theta)[0], assembly.residual(z, found.theta)[1])
        for e, z in zip(experiments, instruments, strict=True)
    ]
    return [r for r, _ in pairs], _baseline(found, pairs, len(assembly.tree.joints))


def _samples(
    found: Fit,
    baseline: Sequence[Sequence[tuple[NDArray[np.int_], Array]]],
    residuals: Sequence[Array],
    noise: Noise,
    keep: NDArray[np.bool_] | None,
    beside: Mapping[int, Parts],
    seed: int,
) -> Samples:
    """The samples in motion (``keep``, (n_band, J)), or all of them (None)."""
    n = sum(map(len, residuals))

    def whiten(c: int, parts: Sequence[Array]) -> Array:
        return noise.whiten_all(c, parts) if keep is None else noise.whiten(c, parts)

    def plain(c: int, parts: Sequence[Array]) -> Array:
        x = np.concatenate(list(parts)) / found.sigma[c]
        return x if keep is None else x[keep[:, c]]

    white, raw = [], []
    block = np.arange(n) * RAW_BLOCKS // n
    for c, parts in enumerate(baseline):
        index, own, columns = parts[0][0], [r[:, c] for r in residuals], [x for _, x in parts]
        r = whiten(c, own)
        innovations = 0 * r if keep is None else noise.innovations[c]
        white.append(
            Channel(index, whiten(c, columns), r, innovations, noise.times if keep is None else noise.blocks(c))
        )
        r = plain(c, own)
        raw.append(Channel(index, plain(c, columns), r, 0 * r, block if keep is None else block[keep[:, c]]))
    evidence = Evidence(white, len(found.theta), noise.n_blocks, NULLS if keep is not None else 1, seed)
    return Samples(evidence, Evidence(raw, len(found.theta), RAW_BLOCKS, 1, seed), whiten, plain, beside)


def _judge(
    samples: Samples,
    noise: Noise,
    options: Sequence[tuple[Variant, dict[int, Parts]]],
    price_of: Callable[[Variant], float],
    null: dict[tuple[int, ...], Array] | None,
    everywhere: Callable[[Variant], dict[int, Parts]],
) -> Judged | None:
    """The best point of an effect's grid and set of amplitudes; None where no point gains anything.

    What noise alone reaches is entered in ``null``.
    """
    best: tuple[float, float, Variant, Array, Case, dict[int, Parts]] | None = None
    for subset in options[0][0].subsets():
        price = price_of(_with(options[0][0], subset))
        for whole, columns in options:
            variant = _with(whole, subset)
            own = {c: [x[:, subset] for x in parts] for c, parts in columns.items()}
            case = samples.case(variant, own)
            gain = case.gain()
            if gain.total <= 0:
                continue
            if best is None or gain.total - price > best[0]:
                best = (gain.total - price, price, variant, gain.amplitudes[: len(subset)], case, own)
            if null is not None:
                reached = tuple(own)
                null[reached] = np.maximum(null.get(reached, 0.0), samples.evidence.null_gains(case.own) - price)
    if best is None:
        return None
    score, price, variant, amplitudes, case, own = best
    columns = {c: noise.whiten(c, parts) for c, parts in own.items()}
    explained = samples.explained(variant, own)
    return Judged(variant, variant.placed, amplitudes, score, price, explained, tuple(own), case, columns, everywhere)


def _tuned(best: Judged | None, judge: Callable[[Sequence[Variant]], Judged | None]) -> Judged | None:
    """The best candidate near a point of its grid: every shape up or down, by ever smaller factors."""
    if best is None:
        return None
    for factor in 1.8 ** (0.5 ** np.arange(TUNINGS)):
        shape = best.variant.parameters
        near = [
            shape * np.where(np.arange(len(shape)) == i, f, 1.0)
            for i in range(len(shape))
            for f in (factor, 1 / factor)
        ]
        other = judge([replace(best.variant, parameters=x) for x in near])
        if other is not None and other.score > best.score:
            best = other
    return best


def _limits(assembly: Assembly, evidence: Evidence, j: Judged, needed: float) -> list[Limit]:
    """The smallest amplitude of an effect that would have passed; none where it has no single amplitude."""
    parameters, amplitudes = j.placed.effect.parameters, j.variant.amplitudes
    if not len(amplitudes) or not all(parameters[i].grid for i in amplitudes[1:]):
        return []
    p = parameters[int(amplitudes[0])]
    # Both bars count: a score above noise, and a share of the residual worth a name.
    energy = sum(float(np.sum(evidence.channels[c].residual ** 2)) for c in j.channels)
    value = evidence.smallest(evidence.products(list(j.columns.items())), max(needed, 0.5 * WORTH * energy))
    return [Limit(j.placed.effect.name, j.placed.at, p.name, value, assembly.unit(j.placed, p))]


def reliably_positive(gains: Array, errors: float = 2.0) -> bool:
    """Mean over blocks left out above zero by so many standard errors (two: one-sided 2.5 %).

    With all of them, or without the best and the worst: one may be where no other has been, and a gain there that
    dwarfs the others is no reason to doubt them.
    """
    inner = np.sort(gains)[1:-1]
    some = [gains, inner] if len(inner) > 2 else [gains]
    return any(bool(np.mean(x) > errors * np.std(x, ddof=1) / np.sqrt(len(x))) for x in some)


def _with(variant: Variant, subset: NDArray[np.int_]) -> Variant:
    """A variant reduced to some of its amplitudes."""
    if not len(variant.amplitudes):
        return variant
    return replace(variant, amplitudes=variant.amplitudes[subset], low=variant.low[subset], high=variant.high[subset])


def _columns(
    found: Fit, experiments: Sequence[Experiment], states: Sequence[Evaluation], variant: Variant
) -> dict[int, Parts]:
    """Columns per channel."""
    per: dict[int, Parts] = {}
    for e, state in zip(experiments, states, strict=True):
        for channel, columns in candidate_columns(found.assembly, e, state, variant):
            per.setdefault(channel, []).append(columns)
    return per


def _baseline(
    found: Fit, residuals: Sequence[tuple[Array, list[Block]]], n_channels: int
) -> list[list[tuple[NDArray[np.int_], Array]]]:
    """For every channel and experiment: free parameters and their columns; those at a bound stay there."""
    channels = []
    for c in range(n_channels):
        parts = []
        for residual, blocks in residuals:
            index, columns = gather(blocks, c)
            keep = ~found.at_bound[index]
            parts.append((index[keep], columns[:, keep] if len(index) else np.zeros((len(residual), 0))))
        channels.append(parts)
    return channels


def _saturated(
    baseline: Sequence[Sequence[tuple[NDArray[np.int_], Array]]],
    pool: Sequence[Sequence[tuple[Variant, dict[int, Parts]]]],
    smooth: Sequence[Parts],
) -> list[Array]:
    """Everything that could explain each channel: baseline, smooth curves, a middle variant of each candidate."""
    columns = [
        [np.concatenate([x for _, x in own]), np.concatenate(parts)]
        for own, parts in zip(baseline, smooth, strict=True)
    ]
    for options in pool:
        for c, parts in options[len(options) // 2][1].items():
            columns[c].append(np.concatenate(parts))
    return [np.concatenate(own, axis=1) for own in columns]
