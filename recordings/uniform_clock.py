"""A recording on a uniform clock: runs between gaps, by splines where time stamps jitter, thinned where fast."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from .filters import thin, thin_half, thinned_length
from .stamps import taken

Array = NDArray[np.float64]
Piece = tuple[Array, Array, Array, Array, float]
"""Time (n,), position, torque and temperature (n, J) of one run, and the mean step [s] that was recorded."""

GAP, HOLE = 1.5, 4.5
"""Steps, in those about them, from which on there is a gap; up to which splines may bridge."""

PLENTY = 0.8
"""Share of what bridging would leave that must be left without, in runs of `LONG` samples or more."""

LONG = 120

ABOUT = 31
"""Steps whose median a step is held against: a recording may change its rate."""

FAST, ENOUGH = 1500.0, 300.0
"""[Hz] Rate from which on a recording is thinned before anything else, and the lowest rate that is left."""


def uniform(time: Array, q: Array, tau: Array, temperature: Array) -> tuple[list[Piece], list[str], float, float]:
    """Runs of samples, what was done in words, the longest step, and the period of all runs [s].

    Parameters
    ----------
    time : array (n,)
        As stamped [s].
    q, tau, temperature : array (n, J)
        NaN where a sample is missing.
    """
    period = float(np.median(np.diff(time)))
    pieces, notes, longest = _uniform_pieces(time, q, tau, temperature, period, GAP)
    if _usable(pieces) < PLENTY * (time[-1] - time[0]):
        bridged = _uniform_pieces(time, q, tau, temperature, period, HOLE)
        if _usable(pieces) < PLENTY * _usable(bridged[0]):
            pieces, notes, longest = bridged
    if 1.0 / period >= FAST:
        every = int(1.0 / (period * ENOUGH))
        pieces = [p for p in (_thinned(piece, every) for piece in pieces) if len(p[0]) > 1]
        notes = [*notes, f"recorded at {1 / period:.4g} Hz: low-passed, and every {every} samples make one"]
        period *= every
        longest = max(longest, period)
    return pieces, notes, longest, period


def _thinned(piece: Piece, every: int) -> Piece:
    """A run at a slower rate: position, torque and temperature through one low-pass without delay."""
    time, q, tau, temperature, step = piece
    half, n = thin_half(every), thinned_length(len(time), every)
    kept = slice(half, half + (n - 1) * every + 1, every) if n else slice(0, 0)
    return time[kept], thin(q, every), thin(tau, every), temperature[kept], step * every


def _usable(pieces: Sequence[Piece]) -> float:
    """Time [s] in runs that are long enough to filter."""
    return float(sum(p[0][-1] - p[0][0] for p in pieces if len(p[0]) >= LONG))


def _uniform_pieces(
    t: Array, q: Array, tau: Array, temperature: Array, period: float, gap: float
) -> tuple[list[Piece], list[str], float]:
    """Cut at gaps; put stamps that jitter, or leave holes, on a uniform clock by cubic splines, and say so.

    Pieces are time, position, torque, temperature, and the mean step that was recorded; the last is the longest step.
    """
    from scipy.interpolate import CubicSpline  # here only: a recording with an even clock never needs it

    good = np.isfinite(q).all(1) & np.isfinite(tau).all(1)
    jitter, off, other_rates, lone, longest = 0.0, 0.0, 0, 0, period
    index = np.flatnonzero(good)
    steps = np.diff(t[index])
    local = np.maximum(median_filter(steps, ABOUT, mode="nearest"), period)
    wide = (
        (steps > gap * local) | np.r_[False, local[1:] > gap * local[:-1]] | np.r_[local[:-1] > gap * local[1:], False]
    )
    cuts = np.flatnonzero(wide | ((np.diff(index) > 1) & (gap < HOLE))) + 1
    pieces: list[Piece] = []
    for run in np.split(index, cuts):
        if len(run) < 4:
            lone += len(run)
            continue
        longest = max(longest, float(np.max(np.diff(t[run])))) if gap == HOLE else longest
        when, stamped_off = taken(t[run], q[run], period)
        off = max(off, stamped_off)
        step = (when[-1] - when[0]) / (len(run) - 1)
        even = when[0] + step * np.arange(len(run))
        deviation = float(np.max(np.abs(when - even))) / period
        jitter = max(jitter, deviation)
        other_rate = abs(step / period - 1) > 1e-3
        other_rates += other_rate
        if deviation <= 0.02 and not other_rate:
            pieces.append((when, q[run], tau[run], temperature[run], period))
            continue
        even = when[0] + period * np.arange(int((when[-1] - when[0]) / period + 1e-9) + 1)
        spline = [CubicSpline(when, x[run])(even) for x in (q, tau)]
        warm = np.stack([np.interp(even, when, x) for x in temperature[run].T], 1)
        pieces.append((even, *spline, warm, float(step)))
    notes = []
    if len(index) < len(t):
        notes.append(f"{len(t) - len(index)} of {len(t)} samples have a missing position or torque and are left out")
    if lone:
        notes.append(f"{lone} samples stand alone between gaps, fewer than four side by side: left out")
    if longest > GAP * period:
        notes.append(
            f"steps of up to {1e3 * longest:.3g} ms between samples are bridged by cubic splines, as gaps there would "
            f"leave little; the analysis band ends at {1 / (2 * longest):.3g} Hz or before"
        )
    if len(pieces) > 1:
        notes.append(f"{len(pieces)} runs between gaps are fitted side by side; nothing is interpolated across a gap")
    if off:
        notes.append(f"the time stamps jitter by {off:.2g} periods, and the positions do not: the jitter is taken out")
    if jitter > 0.02:
        notes.append(
            f"sampling is uneven (stamps up to {jitter:.2g} periods off an even clock): cubic splines put it on "
            f"an even "
            f"{1 / period:.4g} Hz clock inside each run"
        )
    if other_rates and longest <= GAP * period:
        notes.append(f"{other_rates} runs are not sampled at {1 / period:.4g} Hz: cubic splines put them there")
    return pieces, notes, longest
