"""Confirm on the held-out recording what a search took: an effect stays only if taking it out again makes it worse."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .fitting.experiment import Experiment
from .fitting.fit import Fit, channel_rms, fit
from .search.choice import Taken
from .search.forward import Found, carry, without
from .search.rest import begun, fitted, moving
from .search.trial import MOST

Array = NDArray[np.float64]

CONFIRM = 0.05
"""An effect is confirmed if the held-out residual energy of its channels, in motion, rises by this share when it is
taken out, and that over all samples since the first motion rises too (but for friction that rises near rest)."""

SURE = 2.0
"""Standard deviations from zero that one of an effect's amplitudes must have: two names that can swap what they explain
are both far from it until one is gone."""

LEAST = 1e-6
"""An effect that moves no more of the held-out residual's energy, all else as it is, adds nothing."""


@dataclass(frozen=True)
class Confirmed:
    """A search, what of it the held-out recording confirmed and did not, and the fit of what is left.

    ``trials`` gives the relative held-out error with each confirmed effect and without it, on the channel that misses
    it most.
    """

    found: Found
    confirmed: tuple[Taken, ...]
    rejected: tuple[Taken, ...]
    trials: Mapping[str, tuple[float, float]]
    final: Fit


@dataclass(frozen=True)
class _Missed:
    """How much an effect is missed: rise of the held-out energy over the bar, relative errors, and the fit without."""

    rise: float
    trial: tuple[float, float]
    fit: Fit


def confirm(
    found: Found, train: Sequence[Experiment], locked: Sequence[Experiment], progress: Callable[[str], None]
) -> Confirmed:
    """Take out the effect that the held-out recording misses least, all else fitted again, until it misses every one.

    One at a time: of two that stand in for each other, one stays, and is missed more from then on. So the others are
    tried again in the order of how much they were missed before, and only until one is to go.
    """
    progress("confirming on the held-out recording")
    final, since, in_motion = found.fit, [begun(e) for e in locked], [moving(e) for e in locked]
    left = {t.judged.placed.key: t for t in found.taken}
    missed: dict[str, _Missed] = {}
    rejected: list[Taken] = []
    stale = set(left)
    while stale:
        # What was never tried, then what was missed least.
        key = min(stale, key=lambda k: missed[k].rise if k in missed else -np.inf)
        stale.remove(key)
        missed[key] = _missed(left[key], final, train, locked, since, in_motion)
        if any(k not in missed for k in left):
            continue
        weakest = min(left, key=lambda k: missed[k].rise)
        if missed[weakest].rise <= 1 and weakest not in stale:
            rejected.append(left.pop(weakest))
            final = missed.pop(weakest).fit
            stale = set(left)
            progress(f"confirming on the held-out recording: {len(rejected)} not missed, {len(left)} left")
    trials = {key: m.trial for key, m in missed.items()}
    return Confirmed(found, tuple(left.values()), tuple(rejected), trials, final)


def _missed(
    t: Taken,
    final: Fit,
    train: Sequence[Experiment],
    locked: Sequence[Experiment],
    since: Sequence[Experiment],
    in_motion: Sequence[Experiment],
) -> _Missed:
    """Take one effect out of a fit and fit the rest again. Channels are weighted as the fit weights them."""
    c, effect = list(t.judged.channels), t.judged.placed.effect
    with_it, measured = channel_rms(final.assembly, locked, final.theta)
    assembly = without(final, t.judged.placed)
    rest = fit(assembly, fitted(assembly, train), start=carry(final, assembly), multi_start=False)
    rms, _ = channel_rms(assembly, locked, rest.theta)
    worst = c[int(np.argmax(rms[c] / measured[c] - with_it[c] / measured[c]))]
    trial = float(with_it[worst] / measured[worst]), float(rms[worst] / measured[worst])
    # Without an effect that adds nothing, a fit that ends elsewhere says nothing of it.
    adds = channel_rms(assembly, locked, carry(final, assembly))[0]
    if _energy(adds - with_it, c, final) <= LEAST * _energy(with_it, c, final):
        return _Missed(0.0, trial, rest)
    # Nor is a name confirmed that leaves the recording as a whole no better, from its first motion on; friction that
    # rises near rest is read off where the joint creeps, and how a sign is rounded at rest is not its fault.
    since_with, since_without = (channel_rms(x.assembly, since, x.theta)[0] for x in (final, rest))
    worse = _energy(since_without, c, final) <= _energy(since_with, c, final) and not effect.exceeds_at_rest
    if not _known(final, t) or worse:
        return _Missed(0.0, trial, rest)
    # A joint at rest holds what it is given: there, only laws for what happens at rest can be missed.
    moving_with, moving_without = (channel_rms(x.assembly, in_motion, x.theta)[0] for x in (final, rest))

    def rise(after: Array, before: Array) -> float:
        return (_energy(before, c, final) / _energy(after, c, final) - 1) / CONFIRM

    rises = [rise(moving_with, moving_without)]
    if effect.at_rest or effect.exceeds_at_rest:
        rises.append(rise(with_it, rms))
    if effect.exceeds_at_rest:
        creeping = fitted(final.assembly, locked)
        creeping_with, creeping_without = (channel_rms(x.assembly, creeping, x.theta)[0] for x in (final, rest))
        rises.append(rise(creeping_with, creeping_without))
    if effect.remembers:
        # What was named for leaving little near rest must still do so, now that the others are there.
        floor, after, before = (_energy(x, c, final) for x in (moving_with, with_it, rms))
        most = (before - after) / max(after - floor, LEAST * after) * (1 - MOST) / MOST
        # Over all samples it must be missed as much: fits with and without it do not weigh them alike.
        rises = [min(rise(with_it, rms), max(most, rises[0]))]
    return _Missed(max(rises), trial, rest)


def _known(final: Fit, t: Taken) -> bool:
    """Is an amplitude of the effect known to be other than zero? A law without amplitudes is judged by its shape."""
    own = final.assembly.index_of(t.judged.placed)
    amplitudes = [t.judged.placed.effect.parameters[i].name for i in t.judged.variant.amplitudes]
    own = [i for i in own if final.assembly.slots[i].name in amplitudes]
    return not own or bool(np.any(np.abs(final.theta[own]) >= SURE * final.std[own]))


def _energy(rms: Array, channels: Sequence[int], found: Fit) -> float:
    """Of channels, weighted as the fit weights them."""
    return float(np.sum((rms[channels] / found.sigma[channels]) ** 2))
