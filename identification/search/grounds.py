"""What candidates are judged on: the recordings along three readings of their motion, and the samples of each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..fitting.assembly import Evaluation
from ..fitting.experiment import Experiment
from ..fitting.fit import Fit
from ..fitting.problem import gather
from .candidates import Variant, candidate_columns
from .encoder_noise import encoder_torque
from .evidence import Channel, Evidence
from .judged import Parts, Samples
from .rest import bridged, friction_less, in_motion
from .saturated import Noise

Array = NDArray[np.float64]
Baseline = list[list[tuple[NDArray[np.int_], Array]]]
"""For every channel and recording: free parameters of the fit, and their columns."""

RAW_BLOCKS = 12
"""Blocks of unwhitened samples, each predicted from the others."""

NULLS = 200


@dataclass(frozen=True)
class Reading:
    """Recordings along one reading of their motion, with the model evaluated along it."""

    found: Fit
    experiments: Sequence[Experiment]
    states: Sequence[Evaluation]

    def columns(self, variant: Variant) -> dict[int, Parts]:
        """What a variant adds to each channel it reaches: one array (n_band, k) a recording; nothing where its law
        cannot be followed along one of them, as a spring whose link has no inertia."""
        per: dict[int, Parts] = {}
        for e, state in zip(self.experiments, self.states, strict=True):
            try:
                found = candidate_columns(self.found.assembly, e, state, variant)
            except InputError:
                return {}
            for channel, columns in found:
                per.setdefault(channel, []).append(columns)
        return per

    def baseline(self) -> Baseline:
        """The fit's own columns; those of a parameter at a bound are left out, since it stays there."""
        channels: Baseline = []
        blocks = [self.found.assembly.residual(e, self.found.theta)[1] for e in self.experiments]
        for c in range(len(self.found.assembly.tree.joints)):
            parts = []
            for own, e in zip(blocks, self.experiments, strict=True):
                index, columns = gather(own, c)
                keep = ~self.found.at_bound[index]
                parts.append((index[keep], columns[:, keep] if len(index) else np.zeros((len(e.measured), 0))))
            channels.append(parts)
        return channels

    def residuals(self) -> list[Array]:
        """What the fit leaves of every recording (n_band, J)."""
        return [self.found.assembly.residual(e, self.found.theta)[0] for e in self.experiments]


@dataclass(frozen=True)
class Readings:
    """The motion that was asked for, the motion as measured, and the latter with what happens near rest.

    What a disturbance drives is not in the first; how a link rings is not, either.
    """

    asked: Reading
    measured: Reading
    everywhere: Reading


def readings(found: Fit, experiments: Sequence[Experiment], instruments: Sequence[Experiment]) -> Readings:
    """Recordings as they are, and with the motion that was asked for (``instruments``)."""
    asked, exact = ([found.assembly.evaluate(e, found.theta) for e in some] for some in (instruments, experiments))
    return Readings(
        Reading(found, [bridged(z) for z in instruments], asked),
        Reading(found, [bridged(e) for e in experiments], exact),
        Reading(found, experiments, exact),
    )


@dataclass(frozen=True)
class Grounds:
    """Samples that candidates are judged on.

    Parameters
    ----------
    readings : Readings
    noise : Noise
    asked, measured : Samples
        In motion, beside a baseline from that reading.
    near_rest : Samples
        Near rest too; friction above its level is evidence there: whatever sticks stays below it.
    heard : array (J,)
        Share of each channel's residual energy that noise of the encoders accounts for.
    """

    readings: Readings
    noise: Noise
    asked: Samples
    measured: Samples
    near_rest: Samples
    heard: Array

    def excess(self, channel: int) -> float:
        """Share of a channel's residual energy that goes if all samples leave what those in motion leave."""
        whole, moving = (np.mean(x.raw.channels[channel].residual ** 2) for x in (self.near_rest, self.measured))
        return max(1.0 - float(moving / max(whole, 1e-300)), 0.0)


def grounds(r: Readings, noise: Noise, seed: int) -> Grounds:
    """Lay them; ``seed`` is that of the sign-flipped nulls."""
    found, experiments = r.everywhere.found, r.everywhere.experiments
    moving, left = in_motion(experiments), r.measured.residuals()
    asked, measured = (_samples(found, x.baseline(), left, noise, moving, {}, seed) for x in (r.asked, r.measured))
    held = {c: [friction_less(e, c) for e in experiments] for c in range(len(found.sigma))}
    whole = r.everywhere
    near_rest = _samples(found, whole.baseline(), whole.residuals(), noise, None, held, seed)
    noisy = np.mean([encoder_torque(found, e) ** 2 for e in experiments], axis=0)
    energy = [float(np.mean((c.residual * s) ** 2)) for c, s in zip(measured.raw.channels, found.sigma, strict=True)]
    return Grounds(r, noise, asked, measured, near_rest, noisy / np.maximum(energy, 1e-300))


def _samples(
    found: Fit,
    baseline: Baseline,
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
