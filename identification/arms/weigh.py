"""The evidence of recordings of an arm: residuals along the motion as measured, columns along the instrument motion."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.axes import neighbours, place
from ...models.model import Model, PlacedEffect
from ...recordings.condition import Motion
from ..deciding import LEAST_LEVEL, TOLERANCES
from ..evidence.evidence import Evidence, ResidualChannel
from ..evidence.pool import CandidateColumns, Curves, Item
from ..evidence.prior import pool
from ..evidence.weighed import NuisanceColumns, WeighedRecordings, principal
from ..fitting.assembly import TorqueModel
from ..fitting.experiment import Experiment, Scales
from ..fitting.fit import Fit
from ..nuisance.curve import SMALL
from ..nuisance.encoder import encoder_noise
from ..nuisance.learn import learn
from ..nuisance.noise import Noise, NoiseChannel
from ..nuisance.rest import SETTLES, STICKS, share
from ..search.candidates import library
from .hypotheses import ColumnSource, curves, names
from .nuisance_columns import columns_beside
from .periods import Periods, rough_noise

Array = NDArray[np.float64]

QUIET = 0.01
"""RMS torque of the loudest channel that stands for that of a channel which is as good as silent."""

STILL = 0.03
"""Share of the peak speed below which the residual tells how much a joint holds."""

STRONGEST = 40
"""Directions of all that could explain a channel beside which its noise is learnt."""


def torque_scale(train: Sequence[Experiment]) -> Array:
    """RMS torque of each channel (J,)."""
    scale = np.sqrt(np.mean(np.concatenate([e.measured for e in train]) ** 2, axis=0))
    return np.maximum(scale, QUIET * scale.max())


def weigh(
    model: Model,
    found: Fit,
    experiments: Sequence[Experiment],
    instruments: Sequence[Experiment],
    n_train: int,
    scales: Mapping[str, Scales],
    noises: Sequence[Noise] | None = None,
    *,
    runs: list[list[NoiseChannel]] | None = None,
    search: bool = True,
    nameless: Mapping[tuple[int, str], float] | None = None,
    tuned: Mapping[str, Array] | None = None,
    residuals: Sequence[Array] | None = None,
) -> WeighedRecordings:
    """Recordings under a fit.

    Parameters
    ----------
    model : Model
        With the effects of the fit.
    found : Fit
    experiments, instruments : sequence of Experiment
        Recordings, and these recordings along the instrument motion; the first ``n_train`` are for training.
    n_train : int
    scales : mapping of str to Scales
    noises : sequence of Noise or None
        Of each channel; None learns them from the training recordings.
    runs : lists of NoiseChannel, optional
        What the noise of every channel depends on, as another fit has it: two models are compared under one noise.
    search : bool
        False leaves out all hypotheses: only the evidence of the fit itself is wanted.
    nameless : mapping of (channel, words) to float, optional
        Sizes of nameless curves that stand beside every explanation.
    tuned : mapping of str to array, optional
        Parameters of laws that were fitted by themselves.
    residuals : sequence of array (n, J), optional
        Of each recording, where they are not those of the fit along the measured motion.
    """
    assembly = found.assembly
    states = [assembly.evaluate(e, found.theta) for e in instruments]
    along = ColumnSource(
        model, assembly, instruments, states, n_train, torque_scale(experiments[:n_train]), scales, tuned or {}
    )
    columns = CandidateColumns([len(e.measured) for e in experiments])
    nameless = nameless or {}
    by_words = curves(along, columns, small=not search, more={words for _, words in nameless})
    others = columns_beside(along, found, by_words, columns, nameless)
    residuals = residuals or [assembly.residual(e, found.theta)[0] for e in experiments]
    if runs is None:
        runs = _runs(model, found, experiments, residuals, n_train, along.scale)
    J = len(along.scale)
    named = {}
    if search:
        rough = [rough_noise([r[:, c] for r in residuals[:n_train]], [x[c] for x in runs[:n_train]]) for c in range(J)]
        periods = Periods(
            along,
            residuals[:n_train],
            [[x.covariance(own[c]) for c, x in enumerate(noises or rough)] for own in runs[:n_train]],
            others,
            others.weight(max(TOLERANCES)),
        )
        along = replace(along, peaks=periods.of(library(model)))
        named = names(along, by_words, columns)
    if noises is None:
        noises = [
            _noise(c, along, [r[:, c] for r in residuals[:n_train]], runs, others, by_words, named, columns)
            for c in range(J)
        ]
    channels = [
        [ResidualChannel(r[:, c], noises[c].covariance(own[c]), *part[c]) for c in range(J)]
        for r, own, part in zip(residuals, runs, others.parts, strict=True)
    ]
    if not search:
        columns = CandidateColumns([len(e.measured) for e in experiments])
    stated = {axis.name for axis in model.tree.axes}
    coupled = {axis.name for axis in neighbours(model.tree)} - stated
    found_pool = tuple(pool(named, by_words, model.effects, coupled)) if search else ()
    items = [item for h in found_pool for item in h.items]

    @functools.cache
    def bare(c: int) -> Noise:
        return noise_of_rest(c, [np.zeros(len(r)) for r in residuals[:n_train]])

    def noise_of_rest(c: int, missing: Sequence[Array]) -> Noise:
        left = [r[:, c] - x for r, x in zip(residuals[:n_train], missing, strict=True)]
        return _noise(c, along, left, runs, others, by_words, {}, columns)

    evidence = Evidence(channels, columns, items, others.count)
    return WeighedRecordings(
        evidence, found_pool, tuple(noises), others, along.scale, n_train, runs, bare, noise_of_rest
    )


def _runs(
    model: Model,
    found: Fit,
    experiments: Sequence[Experiment],
    residuals: Sequence[Array],
    n_train: int,
    scale: Array,
) -> list[list[NoiseChannel]]:
    """What the noise of every channel of every recording depends on."""
    train, made = experiments[:n_train], []
    several = _axes_of_several(found.assembly)
    for e in experiments:
        row = []
        for c, own in enumerate(np.eye(len(model.joints))):
            m = e.motion
            settles = np.zeros(len(e.measured))
            sticks, level = (settles,) * len(STICKS), 0.0
            if model.tree.sticks(c):
                # A joint rests, and so does it where an axis rests that it is a part of.
                rests = [_rests(m, x, train) for x in (own, *(x for x in several if x[c]))]
                *sticks, settles = (np.max(shares, axis=0) for shares in zip(*rests, strict=True))
                level = _level(found.assembly, found.theta, train, residuals, c, scale[c])
            step, inside, encoder = m.period * m.thinning, m.band_segments(), encoder_noise(e, c)
            row.append(
                NoiseChannel(step, inside, encoder, tuple(sticks), settles, level, pace=_pace(model, m, c, train))
            )
        made.append(row)
    return made


def _pace(model: Model, motion: Motion, c: int, train: Sequence[Experiment]) -> Array | None:
    """A joint's speed as a share of its peak speed (n,). On a suspension or a floating base every joint moves what
    carries the others, which rings as it likes: none is given there."""
    peak = max(float(np.abs(e.motion.qd[:, c]).max()) for e in train)
    return np.abs(motion.to_band(motion.qd)[:, c]) / peak if model.tree.stands and peak > 0 else None


def _axes_of_several(assembly: TorqueModel) -> list[Array]:
    """Axes of several joints that the model states, or at which it has friction: their joints' factors (J,)."""
    rubs = [p.at for p in assembly.placed if p.effect.at == "joint" and p.effect.dissipates]
    names = dict.fromkeys([*(x.name for x in assembly.tree.axes), *rubs])
    places = [place(assembly.tree, name) for name in names]
    return [x.along for x in places if x.alone is None]


def _rests(motion: Motion, along: Array, train: Sequence[Experiment]) -> list[Array]:
    """How much of each sample is near the rest of a joint or an axis: in the zones of sticking, and of settling."""
    peak = max(float(np.abs(e.motion.qd @ along).max()) for e in train)
    travel = max(float(np.ptp(e.motion.q @ along)) for e in train)
    return [share(motion, along, z, max(peak, 1e-12), travel) for z in (*STICKS, SETTLES)]


def _level(
    assembly: TorqueModel,
    theta: Array,
    train: Sequence[Experiment],
    residuals: Sequence[Array],
    channel: int,
    scale: float,
) -> float:
    """How much a joint may hold at rest [T]: its level of dry friction, or the residual there."""
    joint, peak = assembly.tree.joints[channel].name, max(float(np.abs(e.motion.qd[:, channel]).max()) for e in train)
    torque = {
        assembly.unit(p, x) for p in assembly.placed if p.at == joint for x in p.effect.parameters if x.unit == "T"
    }
    known = [abs(float(v)) for s, v in zip(assembly.slots, theta, strict=True) if s.at == joint and s.unit in torque]
    left = [
        r[np.abs(e.motion.to_band(e.motion.qd)[:, channel]) < STILL * peak, channel]
        for e, r in zip(train, residuals, strict=False)
    ]
    still = np.concatenate(left)
    return max([*known, LEAST_LEVEL * scale, float(np.sqrt(np.mean(still**2))) if len(still) > 10 else 0.0])


def _noise(
    channel: int,
    along: ColumnSource,
    residuals: Sequence[Array],
    runs: Sequence[Sequence[NoiseChannel]],
    others: NuisanceColumns,
    by_words: Curves,
    named: Mapping[str, tuple[PlacedEffect, list[Item]]],
    columns: CandidateColumns,
) -> Noise:
    """Scales of a channel's noise from its training residuals (n,), beside the baseline, the masses, small curves and
    the middle of every law."""
    laws: list[int] = []
    for p, items in named.values():
        middle = items[len(items) // 2]
        # What shows near rest, or has a hidden state, follows noise as well as it follows the law.
        if not (p.effect.at_rest or p.effect.exceeds_at_rest or p.effect.states):
            laws += [int(i) for i in middle.index[: middle.label.count] if columns.has(channel, int(i))]
    small = [int(i) for (c, words), x in by_words.items() if c == channel and words in SMALL for i in x.index]
    n = along.n_train

    def beside_all(chosen: Sequence[int]) -> list[Array]:
        parts = []
        for i in range(n):
            own = [others.noise_beside[i][channel], columns.some(i, channel, np.array(chosen, int))]
            parts.append(np.concatenate(own, axis=1))
        return principal(parts, STRONGEST)

    own = [row[channel] for row in runs[:n]]
    return learn(residuals, beside_all([*laws, *small]), own, freely=bool(named), channels=len(runs[0]))
