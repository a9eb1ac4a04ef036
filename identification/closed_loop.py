"""Motion that the servo was asked for, told from motion that a disturbance drove: the regressors' bandwidth per joint.

In closed loop a torque that nobody modelled moves a light joint, and the measured acceleration then carries the very
disturbance that stands in the torque: least squares reads it as inertia, delay or elasticity (Gautier, Janot, Vandanjon
2013; the endogeneity of Brunot et al.). The cure here is an instrument that needs no reference signal: each joint's
motion is low-passed to the band in which the disturbance cannot have driven more than a small share of it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt, welch

from .candidates import smooth_columns
from .experiment import Experiment
from .fit import Fit, gather

Array = NDArray[np.float64]

DRIVEN = 0.002
"""Largest share of a joint's acceleration variance, inside the band kept, that the residual torque could have driven."""

LEAST = 4.0
"""The band kept is never narrower than this many times the frequency that holds 90 % of the speed's energy."""


def planned(found: Fit, experiments: Sequence[Experiment]) -> list[Experiment]:
    """The experiments with every joint's motion low-passed to what was asked of it; torques stay as they are.

    Parameters
    ----------
    found : Fit
        Baseline fit to ``experiments``; what smooth curves cannot take out of its residual counts as disturbance.
    experiments : sequence of Experiment
        Training recordings.

    Returns
    -------
    list of Experiment
        The same objects where no joint needs a filter.
    """
    bands = _bands(found, experiments)
    edge = experiments[0].motion.band
    if all(b >= edge for b in bands):
        return list(experiments)
    return [_low_passed(e, bands) for e in experiments]


def _bands(found: Fit, experiments: Sequence[Experiment]) -> Array:
    """Edge of the band kept [Hz] for every joint."""
    assembly, n_joints = found.assembly, experiments[0].measured.shape[1]
    edge = experiments[0].motion.band
    bands = np.full(n_joints, np.inf)
    for e in experiments:
        residual, blocks = assembly.residual(e, found.theta)
        state = assembly.evaluate(e, found.theta)
        rate = 2 * e.motion.band
        longest = max(e.motion.band_segments(), key=lambda s: s.stop - s.start)
        acceleration, speed = e.motion.to_band(e.motion.qdd)[longest], e.motion.to_band(e.motion.qd)[longest]
        length = min(len(acceleration), int(8 * rate))
        for c in range(n_joints):
            columns = np.concatenate([gather(blocks, c)[1], smooth_columns(e, state, c)], axis=1)
            left = residual[:, c] - columns @ np.linalg.lstsq(columns, residual[:, c], rcond=1e-8)[0]
            inertia = float(np.mean(e.mass_matrix[:, c, c]))
            f, torque = welch(left[longest], rate, nperseg=length)
            _, total = welch(acceleration[:, c], rate, nperseg=length)
            driven = np.cumsum(torque) / inertia**2
            good = np.flatnonzero(driven <= DRIVEN * np.cumsum(total))
            kept = f[good[-1]] if len(good) else 0.0
            _, energy = welch(speed[:, c], rate, nperseg=length)
            most = f[np.searchsorted(np.cumsum(energy), 0.9 * energy.sum())]
            kept = max(kept, LEAST * most, LEAST / (length / rate))
            bands[c] = min(bands[c], kept if kept < 0.9 * edge else np.inf)
    return bands


def _low_passed(experiment: Experiment, bands: Array) -> Experiment:
    """Position, speed and acceleration through the same zero-phase low-pass, joint by joint, segment by segment."""
    motion = experiment.motion
    filtered = {name: getattr(motion, name).copy() for name in ("q", "qd", "qdd")}
    for c, band in enumerate(bands):
        if np.isfinite(band):
            sos = butter(4, band, fs=1 / motion.period, output="sos")
            for x in filtered.values():
                for s in motion.segments:
                    x[s, c] = sosfiltfilt(sos, x[s, c])
    kept = ", ".join(f"{j} {b:.2g} Hz" for j, b in zip(motion.joints, bands, strict=True) if np.isfinite(b))
    note = f"columns for the search come from low-passed motion, because disturbances drive these joints above: {kept}"
    return Experiment(replace(motion, **filtered, notes=(*motion.notes, note)), experiment.body)
