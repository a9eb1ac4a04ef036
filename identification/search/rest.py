"""Samples at which a joint may stick, and what is left of whitened data without them.

A joint at rest holds whatever torque it is given, up to its level: no law of speed says how much, and a sign that is
sampled, or rounded over a small speed as simulators do, says it wrong. What happens there is the same for every kind of
friction, so nothing that is judged may rest on it. Samples near rest count as missing. An autoregression carries each
missing sample into the innovations after it; these are combined so that it drops out, and nothing else is lost
(generalised least squares with one free value for every missing sample).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.floating.tree import n_carriers
from ...models.rig.rig import Rig
from ..fitting.assembly import Assembly
from ..fitting.experiment import Bridge, Experiment

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

REST = 0.02
"""Share of a joint's peak speed below which friction may stick, and a static law says nothing."""

CREEP = 0.01
"""Share of a joint's peak speed down to which a law of the friction above its level is fitted: nearer to rest the sign
of a speed is rounded, and friction falls short of any such law."""

ROUNDING = (0.003, 0.01)
"""Shares of a joint's peak speed over which the sign of a speed may be rounded."""

LONGEST_RUN = 48
"""Missing samples in a row beyond which the noise remembers nothing of the time before them."""


def slow(experiment: Experiment, joint: int, share: float = REST) -> Mask:
    """Samples at which a joint is near rest (n,), with those that differentiation mixes with them.

    Near rest is below a ``share`` of its peak speed; with none, nothing is.

    A floating base is never at rest. On a suspension, which never hangs quite still, friction lets go of what it holds,
    and the joints that stand feel what the others do to the slings: there, every sample counts.
    """
    motion = experiment.motion
    if not share or joint < n_carriers(experiment.body.tree) or isinstance(experiment.body.tree, Rig):
        return np.zeros(len(motion.time), bool)
    speed = motion.qd[:, joint]
    found = np.abs(speed) < share * np.max(np.abs(speed))
    # Slower than that somewhere between two samples, too.
    found[:-1] |= speed[:-1] * speed[1:] < 0
    reach = max(1, motion.thinning // 2)
    for part in motion.segments:
        found[part] = np.convolve(found[part], np.ones(2 * reach + 1), mode="same") > 0
    return found


def bridged(experiment: Experiment) -> Experiment:
    """The same without what happens near rest: it would reach far through the low-pass into the samples in motion."""
    return _bridged(experiment, (REST,) * experiment.measured.shape[1], False)


def moving(experiment: Experiment, shares: Sequence[float] | None = None) -> Experiment:
    """The same, and what lies on the bridges counts for nothing: a line between two samples has their noise.

    ``shares`` of the peak speed are where motion begins, for each channel; `REST` by default.
    """
    return _bridged(experiment, tuple(shares or (REST,) * experiment.measured.shape[1]), True)


def _bridged(experiment: Experiment, shares: tuple[float, ...], drop: bool) -> Experiment:
    key = ("bridged", shares, drop)
    if key not in experiment.store:
        bridges = tuple(_bridge(experiment, slow(experiment, c, share)) for c, share in enumerate(shares))
        kept = None
        if drop:
            kept = np.stack([~near_rest(experiment, c, share) for c, share in enumerate(shares)], 1)
            kept |= ~kept.any(axis=0)  # what is never in motion is all that there is
        experiment.store[key] = experiment.with_bridges(bridges, kept)
    return experiment.store[key]


def begun(experiment: Experiment) -> Experiment:
    """The same, and what a joint holds before it first moves counts for nothing: that hangs on how it came to rest."""
    if "begun" not in experiment.store:
        kept = np.zeros_like(experiment.measured, dtype=bool)
        for c in range(kept.shape[1]):
            going = ~near_rest(experiment, c)
            for part in experiment.motion.band_segments():
                kept[part, c] = np.logical_or.accumulate(going[part])
        kept |= ~kept.any(axis=0)
        experiment.store["begun"] = experiment.with_bridges((), kept)
    return experiment.store["begun"]


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


def fitted(assembly: Assembly, experiments: Sequence[Experiment]) -> list[Experiment]:
    """What a model is fitted to: samples near rest count where it has a law for what happens there."""
    whole = {assembly.joint_of(p) for p in assembly.placed if p.effect.at_rest}
    creeping = {assembly.joint_of(p) for p in assembly.placed if p.effect.exceeds_at_rest}
    joints = range(len(assembly.tree.joints))
    shares = [0.0 if c in whole else CREEP if c in creeping else REST for c in joints]
    return [moving(e, shares) for e in experiments]


def near_rest(experiment: Experiment, joint: int, share: float = REST) -> Mask:
    """Samples of the analysis band that are near rest themselves (n_band,)."""
    motion = experiment.motion
    indicator = slow(experiment, joint, share)
    # Kept samples are those in the middle of the low-pass.
    parts = []
    for s, b in zip(motion.segments, motion.band_segments(), strict=True):
        lead = 0 if motion.thinning == 1 else 4 * motion.thinning
        parts.append(indicator[s][lead :: motion.thinning][: b.stop - b.start])
    return np.concatenate(parts)


def in_motion(experiments: Sequence[Experiment]) -> NDArray[np.bool_]:
    """Samples of the analysis band, all recordings, that no rest of the channel's joint reaches (n_band, J)."""
    joints = range(experiments[0].measured.shape[1])
    return np.concatenate([np.stack([~near_rest(e, c) for c in joints], 1) for e in experiments])


def friction_less(experiment: Experiment, joint: int) -> Array:
    """What friction near rest may fall short of its level by (n_band, 2), for amplitudes that are not negative.

    A joint that sticks, or a sign rounded over a small speed, takes friction away and never adds to it.
    """
    key = ("friction_less", joint)
    if key not in experiment.store:
        speed = experiment.motion.qd[:, joint]
        speed = speed / max(np.max(np.abs(speed)), 1e-300)
        columns = [-np.sign(speed) * np.exp(-((speed / width) ** 2)) for width in ROUNDING]
        experiment.store[key] = experiment.to_band(np.stack(columns, 1), joint)
    return experiment.store[key]


@dataclass(frozen=True)
class Without:
    """Whitened samples of a channel without those near rest.

    ``kept`` (n_white,) marks innovations that no missing sample reaches; ``combined`` holds, for each run of missing
    samples, the innovations it reaches and the combinations of them (n, m) in which it drops out.
    """

    kept: Mask
    combined: tuple[tuple[slice, Array], ...]

    def __call__(self, white: Array) -> Array:
        """(n_white, ...) to (n_left, ...), in the order of time."""
        parts, done = [], 0
        for rows, mix in self.combined:
            parts += [white[done : rows.start][self.kept[done : rows.start]], mix.T @ white[rows]]
            done = rows.stop
        return np.concatenate([*parts, white[done:][self.kept[done:]]])

    def first(self, labels: NDArray[np.int_]) -> NDArray[np.int_]:
        """Labels (n_white,) of what is left; a combination has that of its first innovation."""
        parts, done = [], 0
        for rows, mix in self.combined:
            parts += [
                labels[done : rows.start][self.kept[done : rows.start]],
                np.full(mix.shape[1], labels[rows.start]),
            ]
            done = rows.stop
        return np.concatenate([*parts, labels[done:][self.kept[done:]]])


def without(missing: Sequence[Mask], segments: Sequence[Sequence[slice]], coefficients: Array, lead: int) -> Without:
    """Drop missing samples from innovations.

    Parameters
    ----------
    missing : sequence of array (n_band,)
        Of each recording.
    segments : sequence of sequences of slice
        Runs without a gap, of each recording.
    coefficients : array (order,)
        Autoregression of the channel.
    lead : int
        Samples at the head of each segment that have no innovation.
    """
    taps, order = np.concatenate([[1.0], -coefficients]), len(coefficients)
    kept, combined, offset = [], [], 0
    for mask, parts in zip(missing, segments, strict=True):
        for part in parts:
            own = mask[part]
            n = len(own) - lead
            if n <= 0:
                continue
            clean = np.ones(n, bool)
            at = np.flatnonzero(own)
            for run in np.split(at, np.flatnonzero(np.diff(at) > order + 1) + 1) if len(at) else []:
                start, stop = max(run[0] - lead, 0), min(run[-1] + order + 1 - lead, n)
                if stop <= start:
                    continue
                clean[start:stop] = False
                if len(run) > LONGEST_RUN:
                    continue
                lags = np.arange(start + lead, stop + lead)[:, None] - run
                spread = np.where((lags >= 0) & (lags <= order), taps[np.clip(lags, 0, order)], 0.0)
                combined.append((slice(offset + start, offset + stop), _vanishing(spread)))
            kept.append(clean)
            offset += n
    return Without(np.concatenate(kept) if kept else np.zeros(0, bool), tuple(combined))


def _vanishing(spread: Array) -> Array:
    """Orthonormal combinations (n, m) of the rows of ``spread`` (n, k) that are zero."""
    u, s, _ = np.linalg.svd(spread)
    return u[:, int(np.count_nonzero(s > 1e-9)) :]
