"""One screening: every effect at every place and shape judged on top of a fit, and the noise they are judged
against."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..models.model import Model, Placed
from .assembly import Block, Evaluation
from .candidates import Variant, candidate_columns, free_parameters, library, smooth_columns, variants
from .closed_loop import REST
from .diagnosis import Limit
from .evidence import Channel, Evidence, Products
from .experiment import Experiment
from .fit import Fit
from .problem import gather
from .saturated import Noise, learn

Array = NDArray[np.float64]
Parts = list[Array]
"""One array an experiment."""

RAW_BLOCKS = 12
"""Blocks of unwhitened samples, each predicted from the others."""

WORTH = 0.05
"""Least share of its channels' residual energy that an effect must explain to be named."""

NULLS = 200

LEVEL = 0.995
"""Quantile of the best score on noise that a candidate must beat, among all that reach the same channels."""


@dataclass(frozen=True)
class Judged:
    """A candidate and what the recordings say of it.

    Parameters
    ----------
    variant : Variant
        Best point of the effect's shape grid, and the amplitudes that the data asks for.
    placed : Placed
        Effect and place, with the parameters to hold.
    amplitudes : array (k,)
    score : float
        Log-likelihood gained, less ½ log(samples) for each parameter.
    price : float
        What was taken off.
    explained : float
        Share of the residual energy of the channels it reaches, 0 to 1.
    channels : tuple of int
        Channels it reaches.
    products : Products
    columns : mapping of int to array (n_white, k)
        Its whitened columns on each channel.
    """

    variant: Variant
    placed: Placed
    amplitudes: Array
    score: float
    price: float
    explained: float
    channels: tuple[int, ...]
    products: Products
    columns: Mapping[int, Array]

    def signal(self) -> dict[int, Array]:
        """What it explains of each channel, whitened (n_white,)."""
        return {c: x @ self.amplitudes for c, x in self.columns.items()}

    def start(self) -> dict[str, float]:
        """Starting values by key for the joint refit."""
        full = self.variant.start(self.amplitudes)
        names = [p.name for p in self.placed.effect.parameters]
        return {f"{self.placed.key}.{name}": float(value) for name, value in zip(names, full, strict=True)}


@dataclass(frozen=True)
class Screening:
    """Candidates best first, the score that noise alone reaches on each set of channels, and what nameless curves
    explain."""

    evidence: Evidence
    moving: Evidence
    """The same without the samples near rest of each channel's joint."""
    at_rest: tuple[NDArray[np.bool_], ...]
    judged: tuple[Judged, ...]
    threshold: Mapping[tuple[int, ...], float]
    nameless: Mapping[int, float]
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
    states = [assembly.evaluate(e, found.theta) for e in instruments]
    residuals = [
        (assembly.residual(e, found.theta)[0], assembly.residual(z, found.theta)[1])
        for e, z in zip(experiments, instruments, strict=True)
    ]
    baseline = _baseline(found, residuals, len(model.joints))
    exact = [assembly.evaluate(e, found.theta) for e in experiments]
    pool = []
    for p in library(model):
        # Friction that sticks shows in the smallest motion only: a low-passed one has lost it.
        source = (experiments, exact) if p.effect.at_rest else (instruments, states)
        pool.append([(v, _columns(found, *source, v)) for v in variants(assembly, p)])
    smooth = [
        [smooth_columns(e, s, c) for e, s in zip(instruments, states, strict=True)] for c in range(len(model.joints))
    ]
    if noise is None:
        noise = learn(experiments, [r for r, _ in residuals], _saturated(baseline, pool, smooth))
    white, plain, awake, at_rest = [], [], [], []
    for c, parts in enumerate(baseline):
        index, own = parts[0][0], [r[:, c] for r, _ in residuals]
        columns = [x for _, x in parts]
        rest = noise.whiten_mask(c, [_near_rest(e, c) for e in experiments])
        # Nulls leave the samples near rest out: what sticks there is no noise.
        innovations = noise.innovations[c] * ~rest
        white.append(Channel(index, noise.whiten(c, columns), noise.whiten(c, own), innovations, noise.blocks))
        w = white[-1]
        awake.append(Channel(index, w.columns[~rest], w.residual[~rest], w.noise[~rest], w.block[~rest]))
        at_rest.append(rest)
        r = np.concatenate(own) / found.sigma[c]
        block = np.arange(len(r)) * RAW_BLOCKS // len(r)
        plain.append(Channel(index, np.concatenate(columns) / found.sigma[c], r, 0 * r, block))
    n_parameters = len(found.theta)
    evidence = Evidence(white, n_parameters, int(noise.blocks[-1]) + 1, NULLS, seed)
    moving = Evidence(awake, n_parameters, int(noise.blocks[-1]) + 1, 1, seed)
    raw = Evidence(plain, n_parameters, RAW_BLOCKS, 1, seed)
    energy = np.array([float(np.sum(c.residual**2)) for c in raw.channels])

    judged: list[Judged] = []
    null: dict[tuple[int, ...], Array] = {(c,): np.zeros(NULLS) for c in range(len(model.joints))}
    limits: list[Limit] = []
    log_size = np.log(evidence.size)
    for options in pool:
        best: tuple[float, float, Variant, Array, Products, dict[int, Parts]] | None = None
        for subset in options[0][0].subsets():
            first = _with(options[0][0], subset)
            price = 0.5 * log_size * len(free_parameters(assembly, instruments[0], states[0], first))
            for whole, columns in options:
                variant = _with(whole, subset)
                own = {c: [x[:, subset] for x in parts] for c, parts in columns.items()}
                products = evidence.products([(c, noise.whiten(c, parts)) for c, parts in own.items()])
                gain = evidence.gain(products, variant.low, variant.high)
                if gain.total <= 0:
                    continue
                if best is None or gain.total - price > best[0]:
                    best = (gain.total - price, price, variant, gain.amplitudes, products, own)
                if not variant.placed.effect.at_rest:
                    reached = tuple(own)
                    null[reached] = np.maximum(null.get(reached, 0.0), evidence.null_gains(products) - price)
        if best is None:
            continue
        score, price, variant, amplitudes, products, own = best
        plain_products = raw.products([(c, np.concatenate(x) / found.sigma[c]) for c, x in own.items()])
        explained = 2 * raw.gain(plain_products, variant.low, variant.high).total / energy[list(own)].sum()
        free = free_parameters(assembly, instruments[0], states[0], variant)
        hold = tuple(p.name for p in variant.placed.effect.parameters if p.name not in free)
        placed = replace(variant.placed, hold=hold)
        columns = {c: noise.whiten(c, parts) for c, parts in own.items()}
        judged.append(Judged(variant, placed, amplitudes, score, price, explained, tuple(own), products, columns))
    threshold = {channels: float(np.quantile(x, LEVEL)) for channels, x in null.items()}
    for j in judged:
        rest = j.variant.amplitudes[1:]
        if len(j.variant.amplitudes) and all(j.placed.effect.parameters[i].grid for i in rest):
            p = j.placed.effect.parameters[int(j.variant.amplitudes[0])]
            # Both bars count: a score above noise, and a share of the residual worth a name.
            needed = max(threshold[j.channels] + j.price, 0.5 * WORTH * sum(_energy(white[c]) for c in j.channels))
            value = evidence.smallest(j.products, needed)
            limits.append(Limit(j.placed.effect.name, j.placed.at, p.name, value, assembly.unit(j.placed, p)))
    nameless = {}
    for c, parts in enumerate(smooth):
        products = evidence.products([(c, noise.whiten(c, parts))])
        free = np.full(products.right.shape[1], np.inf)
        gain = evidence.gain(products, -free, free).total - 0.5 * len(free) * log_size
        if gain > threshold[(c,)] and reliably_positive(evidence.fresh_gains(products, -free, free)):
            plain_products = raw.products([(c, np.concatenate(parts) / found.sigma[c])])
            nameless[c] = float(2 * np.sum(raw.fresh_gains(plain_products, -free, free)) / energy[c])
    judged.sort(key=lambda j: -j.score)
    return Screening(evidence, moving, tuple(at_rest), tuple(judged), threshold, nameless, tuple(limits), noise)


def _energy(channel: Channel) -> float:
    return float(np.sum(channel.residual**2))


def reliably_positive(gains: Array, errors: float = 2.0) -> bool:
    """Mean over blocks left out above zero by so many standard errors (two: one-sided 2.5 %)."""
    return bool(np.mean(gains) > errors * np.std(gains, ddof=1) / np.sqrt(len(gains)))


def _near_rest(experiment: Experiment, joint: int) -> NDArray[np.bool_]:
    """Samples of the analysis band within REST of the joint's peak speed from standing still."""
    speed = np.abs(experiment.motion.to_band(experiment.motion.qd)[:, joint])
    return speed < REST * np.max(speed)


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
