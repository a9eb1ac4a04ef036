"""Samples at which a joint may stick, and the samples to which a model is fitted without them.

A joint at rest holds any torque up to its level. No law of speed predicts which; a sign that is sampled, or rounded
over a small speed as in simulators, predicts it wrongly. Nothing is fitted to such samples, unless a law describes
friction near rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..fitting.assembly import TorqueModel
from ..fitting.experiment import Bridge, Experiment

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

REST = 0.02
"""Share of a joint's peak speed below which friction may stick, and a static law says nothing."""

CREEP = 0.01
"""Share of a joint's peak speed down to which a law of the friction above its level is fitted: nearer to rest the sign
of a speed is rounded, and friction falls short of any such law."""


@dataclass(frozen=True)
class AxisRest:
    """An axis of several joints that rubs: its joints' factors ``along`` (J,), and the share of its peak speed where
    its motion begins."""

    along: tuple[float, ...]
    share: float


def slow(experiment: Experiment, joint: int, share: float = REST, axes: Sequence[AxisRest] = ()) -> Mask:
    """Samples at which a joint is near rest (n,), or one of the axes that act on it, with those that differentiation
    mixes with them.

    Near rest is below a ``share`` of the peak speed; without a share, no sample is near rest.

    A floating base is never at rest. On a suspension, which never hangs quite still, friction lets go of what it holds,
    and the joints that stand feel what the others do to the slings: there, every sample counts.
    """
    motion = experiment.motion
    found = np.zeros(len(motion.time), bool)
    own = [(motion.qd[:, joint], share)] + [(motion.qd @ x.along, x.share) for x in axes if x.along[joint]]
    own = [(speed, least) for speed, least in own if least]
    if not own or not experiment.body.tree.sticks(joint):
        return found
    for speed, least in own:
        found |= np.abs(speed) < least * np.max(np.abs(speed))
        # Slower than that somewhere between two samples, too.
        found[:-1] |= speed[:-1] * speed[1:] < 0
    reach = max(1, motion.thinning // 2)
    for part in motion.segments:
        found[part] = np.convolve(found[part], np.ones(2 * reach + 1), mode="same") > 0
    return found


def moving(
    experiment: Experiment, shares: Sequence[float] | None = None, axes: tuple[AxisRest, ...] = ()
) -> Experiment:
    """The experiment without its samples near rest.

    They are bridged, because the low-pass would carry them far into the samples in motion. Samples on a bridge do not
    count: a line between two samples has the noise of these two.

    ``shares`` of the peak speed are where motion begins, for each channel; `REST` by default. Where an axis rests, all
    its joints do.
    """
    own = tuple(shares or (REST,) * experiment.measured.shape[1])
    key = ("moving", own, axes)
    if key not in experiment.store:
        bridges = tuple(_bridge(experiment, slow(experiment, c, share, axes)) for c, share in enumerate(own))
        kept = np.stack([~near_rest(experiment, c, share, axes) for c, share in enumerate(own)], 1)
        kept |= ~kept.any(axis=0)  # what is never in motion is all that there is
        experiment.store[key] = experiment.with_bridges(bridges, kept)
    return experiment.store[key]


def _bridge(experiment: Experiment, rest: Mask) -> Bridge:
    """Across the samples at rest (n,), inside each run without a gap."""
    empty = np.zeros(0, int)
    parts = [(empty, empty, empty, np.zeros(0))]
    for s in experiment.motion.segments if rest.any() else ():
        good, at = (np.flatnonzero(x) + s.start for x in (~rest[s], rest[s]))
        if len(at) and len(good):
            after = np.searchsorted(good, at)
            one, other = good[np.maximum(after - 1, 0)], good[np.minimum(after, len(good) - 1)]
            parts.append((at, one, other, (at - one) / np.maximum(other - one, 1)))
    return Bridge(*(np.concatenate(x) for x in zip(*parts, strict=True)))


def fitted(assembly: TorqueModel, experiments: Sequence[Experiment]) -> list[Experiment]:
    """The samples to which a model is fitted: those near rest count where the model has a law for them."""
    shares, axes = [REST] * len(assembly.tree.joints), {}
    for p in assembly.placed:
        if p.effect.at != "joint" or p.effect.acts_on != "torque":
            continue
        share = 0.0 if p.effect.at_rest else CREEP if p.effect.exceeds_at_rest else REST
        where = assembly.place_of(p)
        if where.alone is not None:
            shares[where.alone] = min(shares[where.alone], share)
        elif p.effect.dissipates:
            axes[p.at] = AxisRest(tuple(where.along.tolist()), min(share, axes[p.at].share if p.at in axes else REST))
    return [moving(e, shares, tuple(axes.values())) for e in experiments]


def near_rest(experiment: Experiment, joint: int, share: float = REST, axes: Sequence[AxisRest] = ()) -> Mask:
    """Samples of the analysis band that are near rest themselves (n_band,)."""
    motion = experiment.motion
    indicator = slow(experiment, joint, share, axes)
    # Kept samples are those in the middle of the low-pass.
    parts = []
    for s, b in zip(motion.segments, motion.band_segments(), strict=True):
        lead = 0 if motion.thinning == 1 else 4 * motion.thinning
        parts.append(indicator[s][lead :: motion.thinning][: b.stop - b.start])
    return np.concatenate(parts)
