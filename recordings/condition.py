"""Conditioning (step 0 of a diagnosis): from a recording to motion, rates and torques in one known band.

Three linear-phase FIR filters, so that every sample is either exact or left out:

1. Position is differentiated by the derivative of a windowed sinc: flat to the analysis band's edge, known bandwidth,
   exact for constants, ramps and parabolas (the moment conditions are enforced).
2. Measured and modelled torques, and every column of the model's Jacobian, pass the *same* low-pass and are thinned to
   twice the band (parallel filtering: Gautier 1997; Janot, Vandanjon, Gautier 2014). What aliases does so alike in
   both.
3. Samples whose filter window leaves the recording, or touches a gap, are dropped, never padded. Where holes of a few
   samples, or a clock that jitters, would leave little between gaps, cubic splines bridge them and the notes say so;
   the band then ends where the longest step bridged still carries it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from ..errors import InputError, nearest
from .filters import derivative_half, derivative_kernels, low_pass, thin, thin_half, thinned_length
from .uniform_clock import uniform

Array = NDArray[np.float64]

BAND_CAP = 40.0
"""[Hz] Above it, drives and structures have dynamics that a rigid-body model does not claim."""

NOISE_SHARE = 0.1
"""Largest noise-to-signal ratio of the derived acceleration: 0.1 biases an inertia by 1 % (errors in variables)."""

MINIMUM_SAMPLES = 50
"""Fewest samples in the analysis band that a fit is tried on."""

LEAST_KEPT = 120
"""Samples in the analysis band that a recording keeps, filters' ends included, however noisy its encoders are."""

MINIMUM_RUN = 16
"""Fewest samples in the analysis band that a run between gaps must leave; a noise model remembers up to 12."""


FEWEST = 64
"""Samples in the longest run from which on its spectrum tells the encoders' noise."""


@dataclass(frozen=True)
class Motion:
    """One recording on a uniform clock, ready to be fitted.

    Parameters
    ----------
    path : str
        The recording's file.
    joints : tuple of str
        Joint names, in the model's order.
    period : float
        Sample period [s].
    band : float
        Edge of the analysis band [Hz]; half the rate that `to_band` thins to.
    time : array (n_samples,)
        Recording's own clock [s].
    q, qd, qdd : array (n_samples, n_joints)
        Position and its derivatives, band-limited [rad or m, per s, per s²].
    tau : array (n_samples, n_joints)
        Measured torque, unfiltered [N·m or N].
    temperature : array (n_samples, n_joints)
        [°C]; NaN where the recording has none.
    segments : tuple of slice
        Runs of samples without a gap, in which all of the above are known.
    thinning : int
        Every how many samples `to_band` keeps one.
    notes : tuple of str
        What was done to the recording, in words.
    encoder_noise : array (3, n_joints)
        Standard deviation of position, rate and acceleration in the analysis band that white noise of the encoders,
        steps included, makes [rad or m, per s, per s²].
    silent : tuple of int
        Channels whose torque is zero throughout, but for a floor of noise.
    undriven : tuple of int
        Channels that nothing drives: their torque is known to be zero.
    """

    path: str
    joints: tuple[str, ...]
    period: float
    band: float
    time: Array
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    temperature: Array
    segments: tuple[slice, ...]
    thinning: int
    notes: tuple[str, ...]
    encoder_noise: Array
    silent: tuple[int, ...] = ()
    undriven: tuple[int, ...] = ()

    def to_band(self, x: Array) -> Array:
        """Low-pass and thin an array (n_samples, ...) segment by segment: (n_band, ...)."""
        return np.concatenate([thin(x[s], self.thinning) for s in self.segments])

    def band_segments(self) -> tuple[slice, ...]:
        """Where each segment stands in the output of `to_band`."""
        stops = np.cumsum([0] + [thinned_length(s.stop - s.start, self.thinning) for s in self.segments])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(stops))


def condition(dataset: xr.Dataset, joints: Sequence[str], band: float | None = None, *, fitted: bool = True) -> Motion:
    """Bring a recording onto a uniform clock, differentiate it, and choose its analysis band.

    Parameters
    ----------
    dataset : xarray.Dataset
        From `read_recording`; needs ``q.<joint>`` and ``tau.<joint>`` for every joint.
    joints : sequence of str
        Joint names, in the model's order.
    band : float, optional
        Edge of the analysis band [Hz], lowered to a whole number of samples for one: a quarter of the sample rate at
        most. By default the lowest of 40 Hz, that, and the band in which the noise of the derived acceleration stays
        below a tenth of its signal on every moving joint; never so narrow that a recording long enough is left short.
    fitted : bool
        Whether torques will be compared in the band; a motion that is only followed may be shorter.

    Raises
    ------
    InputError
        A joint without signal, a band the sampling cannot carry, too few samples.
    """
    path = str(dataset.attrs.get("path", "recording"))
    wanted = [f"{kind}.{j}" for j in joints for kind in ("q", "tau")]
    missing = [name for name in wanted if name not in dataset]
    if missing:
        known = sorted(str(v) for v in dataset.data_vars)
        family = missing[0].partition(".")[0]
        near = nearest(missing[0], [n for n in known if n.partition(".")[0] == family and n not in wanted])
        hint = f"; nearest is {near!r}" if near else ""
        raise InputError(
            f"{path}: no signal {missing[0]!r} for a joint of the URDF, only {', '.join(known)}{hint}; add the column, "
            "or map it under [signals] in the model file"
        )
    stamps = np.asarray(dataset["time"].values, float)
    q, tau = (np.stack([np.asarray(dataset[f"{k}.{j}"].values, float) for j in joints], 1) for k in ("q", "tau"))
    temperature = np.stack(
        [
            np.asarray(dataset[f"temp.{j}"].values, float) if f"temp.{j}" in dataset else np.full(len(stamps), np.nan)
            for j in joints
        ],
        1,
    )
    notes = list(dataset.attrs.get("notes", ()))
    pieces, uniform_note, longest, period = uniform(stamps, q, tau, temperature)
    notes += uniform_note
    rate = 1.0 / period
    limit = "as asked"
    positions = max([p[1] for p in pieces], key=len, default=np.zeros((0, len(joints))))
    white = _white_level(positions, period)
    if band is None:
        edge = min(BAND_CAP, rate / 2.5, 1 / (2 * longest))
        needed = LEAST_KEPT / (2 * period * sum(len(p[0]) for p in pieces)) if fitted and pieces else 0.0
        band, limit = _band_from_noise(positions, white, period, edge, min(max(needed, edge / 20), edge))
    elif not 0 < band <= rate / 2.5:
        raise InputError(
            f"{path}: bandwidth {band:g} Hz cannot be carried at {rate:.4g} samples a second; "
            f"allowed is 0 < bandwidth <= {rate / 2.5:.4g} Hz: give one in the model file"
        )
    band = min(band, 1 / (2 * longest))
    thinning = max(1, int(np.ceil(rate / (2 * band) - 1e-9)))
    band = rate / (2 * thinning)
    notes.append(f"analysis band 0 to {band:.3g} Hz ({limit}; every {thinning} samples make one)")
    half = derivative_half(min(band, rate / 2.5), rate)
    shortest = 2 * half + 1 + (2 * thin_half(thinning) + MINIMUM_RUN * thinning if fitted else 0)
    # Beside a far slower recording the band may ask for kernels that take minutes, for runs that are all too short.
    enough = any(len(p[0]) >= shortest for p in pieces)
    kernels = derivative_kernels(min(band, rate / 2.5), rate) if enough else ()
    parts, segments, start = [], [], 0
    for t, pq, ptau, ptemp, step in pieces:
        if step > 1 / (2 * band):
            notes.append(
                f"{t[0]:.3f} s to {t[-1]:.3f} s is sampled at {1 / step:.3g} Hz, too slow for the band: left out"
            )
            continue
        if len(t) < shortest:
            notes.append(f"{len(t)} samples from {t[0]:.3f} s on stand alone between gaps: too few to filter, left out")
            continue
        derived = [fftconvolve(pq, k[:, None], mode="valid", axes=0) for k in kernels]
        inner = slice(half, len(t) - half)
        parts.append((t[inner], *derived, ptau[inner], ptemp[inner]))
        segments.append(slice(start, start + len(t) - 2 * half))
        start = segments[-1].stop
    kept = sum(thinned_length(s.stop - s.start, thinning) for s in segments)
    if not parts or (fitted and kept < MINIMUM_SAMPLES):
        raise InputError(
            f"{path}: too few samples: {len(stamps)} rows leave {kept} in the {band:.3g} Hz analysis band, at least "
            f"{MINIMUM_SAMPLES if fitted else 1} are needed; record longer, or close the gaps"
        )
    # One joint's samples side by side: laws and filters go through them joint by joint.
    time, q, qd, qdd, tau, temperature = (np.asfortranarray(np.concatenate(c)) for c in zip(*parts, strict=True))
    return Motion(
        path,
        tuple(joints),
        period,
        band,
        time,
        q,
        qd,
        qdd,
        tau,
        temperature,
        tuple(segments),
        thinning,
        tuple(notes),
        np.sqrt([white * rate / 2 * np.sum(np.convolve(k, low_pass(thinning)) ** 2) for k in kernels]),
    )


def _power(position: Array, period: float) -> tuple[Array, Array]:
    """Frequencies [Hz], and one-sided power spectral density of a run without its trend (n_f, n_joints)."""
    n = len(position)
    window = np.hanning(n)[:, None]
    trend = np.linspace(0, 1, n)[:, None]
    detrended = position - position[0] - trend * (position[-1] - position[0])
    power = np.abs(np.fft.rfft(detrended * window, axis=0)) ** 2 * period / np.sum(window**2) * 2
    return np.asarray(np.fft.rfftfreq(n, period), float), power


def _white_level(position: Array, period: float) -> Array:
    """Encoder noise (n_joints,) [per Hz]: the level of the upper quarter of the spectrum, where no arm moves."""
    if len(position) < FEWEST:
        return np.zeros(position.shape[1])
    f, power = _power(position, period)
    return np.median(power[f > 0.375 / period], axis=0) / np.log(2)


def _band_from_noise(position: Array, white: Array, period: float, edge: float, narrowest: float) -> tuple[float, str]:
    """Widest band <= edge in which derived acceleration noise is below NOISE_SHARE of its signal, on moving joints."""
    if len(position) < FEWEST:
        return edge, "few samples: the widest band"
    f, power = _power(position, period)
    signal = np.maximum(power - white, 0) * (2 * np.pi * f[:, None]) ** 4
    moving = np.ptp(position, axis=0) > 20 * np.sqrt(white / period / 2)
    if not moving.any():
        return edge, "no joint moves: the widest band"
    for band in np.geomspace(edge, edge / 20, 40):
        if band < narrowest:
            break
        noise = white * (2 * np.pi) ** 4 * band**5 / 5
        energy = np.sum(signal[f <= band], axis=0) * f[1]
        if np.all(noise[moving] <= NOISE_SHARE**2 * energy[moving]):
            why = "the cap" if band == edge else "beyond it encoder noise would reach the acceleration"
            return float(band), why
    return float(narrowest), "encoder noise is high: the narrowest band tried"
