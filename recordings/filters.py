"""Linear-phase filters of conditioning: derivatives of a windowed sinc, and the low-pass that thins."""

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal.windows import kaiser

Array = NDArray[np.float64]

GROUP = 16
"""Kept samples that are filtered together."""


def derivative_kernels(band: float, rate: float) -> tuple[Array, Array, Array]:
    """Convolution kernels for position, rate and acceleration: windowed sinc and its derivatives, moments exact."""
    cutoff, half = _cutoff(band, rate), derivative_half(band, rate) // 2
    k = np.arange(-half, half + 1)
    window = kaiser(2 * half + 1, 7.857)  # 80 dB
    w = 2 * np.pi * cutoff / rate
    x = np.where(k == 0, 1.0, w * k)
    zero = k == 0
    h0 = np.where(zero, 1.0, np.sin(x) / x) * w / np.pi
    h1 = np.where(zero, 0.0, (np.cos(x) - np.sin(x) / x) / x) * w**2 / np.pi
    smooth = _with_moments(h0 * window, window, (1.0, 0.0, 0.0, 0.0))
    # Convolution runs backwards: sum h[k] x[n-k], so a ramp of slope 1 needs the first moment -1.
    slope = _with_moments(h1 * window, window, (0.0, -1.0, 0.0, 0.0)) * rate
    # Twice the first derivative: windowing the ideal second derivative would leave a constant error over the band.
    second = np.convolve(slope, slope)
    return np.pad(smooth, half), np.pad(slope, half), second


def derivative_half(band: float, rate: float) -> int:
    """Samples that the derivatives' kernels reach to either side: a Kaiser window of 80 dB."""
    width = 2 * (_cutoff(band, rate) - band)
    return 2 * (int(np.ceil(72 / (2.285 * 2 * np.pi * width / rate) / 2)) + 2)


def _cutoff(band: float, rate: float) -> float:
    return min(2.5 * band, 0.5 * (band + 0.5 * rate))


def _with_moments(h: Array, window: Array, moments: Sequence[float]) -> Array:
    """Least change of a kernel, under its window, that makes its moments (in samples) what they must be."""
    half = len(h) // 2
    powers = (np.arange(-half, half + 1)[:, None] / half) ** np.arange(len(moments))
    wanted = np.asarray(moments) / half ** np.arange(len(moments))
    basis = powers * window[:, None]
    return h + basis @ np.linalg.solve(powers.T @ basis, wanted - powers.T @ h)


def thin_half(thinning: int) -> int:
    """Samples that the low-pass reaches to either side."""
    return 0 if thinning == 1 else 4 * thinning


def thinned_length(n: int, thinning: int) -> int:
    """Samples that `thin` leaves of n."""
    inner = n - 2 * thin_half(thinning)
    return max(0, -(-inner // thinning))


def thin(x: Array, thinning: int) -> Array:
    """Kaiser-windowed sinc, half amplitude at half the thinned rate, evaluated at the kept samples only."""
    if thinning == 1:
        return x
    n = thinned_length(len(x), thinning)
    if n == 0:
        return x[:0]
    taps = _group_taps(thinning)
    columns = x.reshape(len(x), -1).T
    groups = -(-n // GROUP)
    windows = np.zeros((len(columns), groups, len(taps)))
    whole = (len(x) - len(taps)) // (GROUP * thinning) + 1 if len(x) >= len(taps) else 0
    if whole:
        view = np.lib.stride_tricks.sliding_window_view(columns, len(taps), axis=1)
        windows[:, :whole] = view[:, :: GROUP * thinning][:, :whole]
    for k in range(whole, groups):
        rest = columns[:, k * GROUP * thinning :]
        windows[:, k, : min(rest.shape[1], len(taps))] = rest[:, : len(taps)]
    kept = (windows.reshape(-1, len(taps)) @ taps).reshape(len(columns), -1)[:, :n]
    return kept.T.reshape(n, *x.shape[1:])


@functools.cache
def _group_taps(thinning: int) -> Array:
    """The low-pass of `GROUP` kept samples in a row (n_taps, GROUP): one matrix product filters them all."""
    h = low_pass(thinning)
    taps = np.zeros(((GROUP - 1) * thinning + len(h), GROUP))
    for i, column in enumerate(taps.T):
        column[i * thinning : i * thinning + len(h)] = h
    return taps


def low_pass(thinning: int) -> Array:
    """The low-pass before thinning: its impulse response, which sums to one."""
    half = thin_half(thinning)
    k = np.arange(-half, half + 1)
    h = np.sinc(k / thinning) * kaiser(2 * half + 1, 6.0)
    return h / h.sum()
