"""What the noise of a docking's channels depends on: balls that touch and slide, a carriage that stands."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..deciding import LEAST_LEVEL, STICKS
from ..nuisance.noise import NoiseChannel
from ..sources.source import Linearisation
from .recording import EVERY, KNOTS, DockingRecording

Array = NDArray[np.float64]

ABOUT = 3
"""Windows either way over which what nothing explains is averaged: 0.3 s, a touch and its rebound."""


def touching(record: DockingRecording, seen: Array) -> NDArray[np.bool_]:
    """Windows (n,) in which balls touch and slide, and those about them: the load on the target changes fast."""
    change = _change(seen)
    loads = [c for c, name in enumerate(record.channels) if name.startswith(("force.", "torque."))]
    fast = change[:, loads or range(len(record.channels))].max(axis=1) > STICKS[0][0]
    return np.logical_or.reduce([np.roll(fast, k) for k in (-1, 0, 1)])


def standing(record: DockingRecording) -> NDArray[np.bool_]:
    """Windows (n,) in which the carriage stands, and takes any force up to its friction."""
    rate = record.motion.rate[::KNOTS]
    slowest = np.minimum(np.abs(rate[1:]), np.abs(rate[:-1]))
    return (slowest < STICKS[0][0] * np.abs(rate).max()) | (rate[1:] * rate[:-1] < 0)


def slid(record: DockingRecording) -> NDArray[np.bool_]:
    """Windows (n,) since the carriage first moved under closed latches: the seats slid then, and what their friction
    keeps of the preload from then on no law of contact tells."""
    closed = record.times[1:] > record.motion.latch[1]
    return np.logical_or.accumulate(closed & ~standing(record))


def noise_channels(
    records: Sequence[DockingRecording], linear: Linearisation, could: Sequence[Sequence[Array]], scale: Array
) -> list[list[NoiseChannel]]:
    """What the noise of every channel depends on.

    While balls touch and slide no law of contact tells the load to the window: a channel may then be off, as a joint
    near rest may hold any torque, by what nothing explains there, in the RMS over `ABOUT` windows either way, and by
    `LEAST_LEVEL` of its size at least, a vector's of the largest of its axes. A motor whose carriage stands may hold
    anything up to its friction. A latch's pull may wander once its seat has slid (`slid`). Where a channel changes fast
    it may be off by more, which the noise learns.

    Parameters
    ----------
    records : sequence of DockingRecording
    linear : Linearisation
        Their residuals.
    could : sequence of sequence of array (n, k)
        What could explain each channel's of each.
    scale : array (c,)
    """
    seen = [np.nan_to_num(r.measured) - left for r, left in zip(records, linear.residuals, strict=True)]
    kinds = [name.rpartition(".")[0] for name in records[0].channels]
    least = [LEAST_LEVEL * max(x for x, other in zip(scale, kinds, strict=True) if other == kind) for kind in kinds]
    loose = [touching(r, x) for r, x in zip(records, seen, strict=True)]
    found: list[list[NoiseChannel]] = [[] for _ in records]
    for c, name in enumerate(records[0].channels):
        driven = name.startswith(("tau.", "tension."))
        rows = [(standing(r) & (name == "tau.carriage")) if driven else k for r, k in zip(records, loose, strict=True)]
        left = np.concatenate([r[k, c] for r, k in zip(linear.residuals, rows, strict=True)])
        columns = np.concatenate([x[k] for x, k in zip(could[c], rows, strict=True)])
        touches = _touches(rows)
        left = _unexplained(left, columns, touches)
        ends = np.cumsum([k.sum() for k in rows])[:-1]
        for own, part, k, r, x in zip(found, np.split(left, ends), rows, records, seen, strict=True):
            energy, count = np.zeros(len(k)), np.convolve(k, np.ones(2 * ABOUT + 1), "same")
            energy[k] = part**2
            energy = np.convolve(energy, np.ones(2 * ABOUT + 1), "same") / np.maximum(count, 1)
            sticks = np.where(k, np.maximum(np.sqrt(energy), least[c]), 0.0)
            n = len(k)
            wanders = slid(r).astype(float) if name.startswith("tension.") else 1.0
            own.append(NoiseChannel(EVERY, (slice(0, n),), np.zeros(n), (sticks,), _change(x)[:, c], 1.0, wanders))
    return found


def _unexplained(left: Array, columns: Array, touch: NDArray[np.int_]) -> Array:
    """What is left (n,) in each touch, or stand of the carriage, by what could explain the others (n, k), or by nothing
    where that is nearer.

    Each is short, and a few columns explain any one: what it has in common with no other is noise.
    """
    found = left.copy()
    for own in (touch == x for x in np.unique(touch)):
        rest = left[own] - columns[own] @ np.linalg.lstsq(columns[~own], left[~own], rcond=1e-6)[0]
        found[own] = np.where(np.abs(rest) < np.abs(left[own]), rest, left[own])
    return found


def _touches(rows: Sequence[NDArray[np.bool_]]) -> NDArray[np.int_]:
    """Number (n,) of the touch, or stand, that each of these windows is in: a run of them in one recording."""
    begun = [k & ~np.concatenate([[False], k[:-1]]) for k in rows]
    number: NDArray[np.int_] = np.cumsum(np.concatenate(begun), dtype=int)
    return number[np.concatenate(list(rows))]


def _change(seen: Array) -> Array:
    """How fast each channel changes (n, c), as a share of its fastest."""
    rates = np.abs(np.gradient(seen, axis=0))
    return rates / np.maximum(rates.max(axis=0), 1e-300)
