"""The instrument motion: the measured motion, low-passed to the band that the servo and not a disturbance drove.

In closed loop an unmodelled torque moves a light joint, and the measured acceleration then contains the disturbance of
the torque; on a heavy joint, encoder noise has this effect. Least squares reads either as inertia, delay or elasticity
(Gautier, Janot, Vandanjon 2013; the endogeneity of Brunot et al.). The cure here is an instrument that needs no
reference signal: each joint's motion is low-passed to the band in which what the model cannot explain is no more than a
small share of it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt, welch

from ..fitting.experiment import Experiment
from ..fitting.fit import Fit
from ..fitting.problem import gather
from .curves import smooth_columns
from .rest import REST

Array = NDArray[np.float64]

LEAST = 4.0
"""The band kept is never narrower than this many times the frequency that holds 90 % of the speed's energy."""

SHORTEST = 16
"""Samples that a spectrum is taken over at least, where eight seconds hold fewer."""


def planned(
    found: Fit,
    experiments: Sequence[Experiment],
    before: Sequence[Experiment] | None = None,
    *,
    others: Sequence[Experiment] = (),
    driven: float,
) -> list[Experiment]:
    """The experiments along the instrument motion of every joint; torques are unchanged.

    Parameters
    ----------
    found : Fit
        Fit to ``experiments``; what smooth curves and a change of direction cannot take out of its residual counts as
        disturbance. The more physics the model has, the wider the bands.
    experiments : sequence of Experiment
        Training recordings.
    before : sequence of Experiment, optional
        An earlier answer; given back where the bands have hardly changed, since its columns are worked out already.
    others : sequence of Experiment
        Recordings that are low-passed alike and say nothing of the bands; they follow the training recordings.
    driven : float
        Largest share of a joint's jerk (derivative of acceleration: what a late sensor's column is made of) inside the
        band kept that the unexplained torque may account for.

    Returns
    -------
    list of Experiment
        The same objects where no joint needs a filter.
    """
    bands = _bands(found, experiments, driven)
    edge = experiments[0].motion.band
    if before is not None:
        old = before[0].store.get("bands", np.full(len(bands), np.inf))
        if np.all(np.abs(np.log(np.minimum(bands, edge) / np.minimum(old, edge))) < 0.25):
            return list(before)
    if all(b >= edge for b in bands):
        return [*experiments, *others]
    return [_low_passed(e, bands) for e in (*experiments, *others)]


def _bands(found: Fit, experiments: Sequence[Experiment], share: float) -> Array:
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
        length = min(len(acceleration), max(int(8 * rate), SHORTEST))
        # Nothing is asked of a floating base: what disturbs it is its motion.
        for c in range(assembly.tree.carriers, n_joints):
            index, own = gather(blocks, c)
            fitted = [own] if len(index) else []
            columns = np.concatenate([*fitted, *smooth_columns([e], [state], c), _directed(e, c)], axis=1)
            left = residual[:, c] - columns @ np.linalg.lstsq(columns, residual[:, c], rcond=1e-8)[0]
            # Friction that sticks is physics that the model may lack, not a disturbance.
            left = left * (np.abs(e.motion.to_band(e.motion.qd)[:, c]) > REST * np.max(np.abs(e.motion.qd[:, c])))
            inertia = float(np.mean(e.mass_matrix[:, c, c]))
            f, torque = welch(left[longest], rate, nperseg=length)
            _, total = welch(acceleration[:, c], rate, nperseg=length)
            driven = np.cumsum(torque * f**2)
            _, energy = welch(speed[:, c], rate, nperseg=length)
            most = np.searchsorted(np.cumsum(energy), 0.9 * energy.sum())
            least = max(LEAST * f[most], LEAST * f[1])
            bad = np.flatnonzero((driven > share * np.cumsum(total * f**2) * inertia**2) & (f > least))
            kept = max(least, f[bad[0]]) if len(bad) else np.inf
            bands[c] = min(bands[c], kept if kept < 0.9 * edge else np.inf)
    return bands


def _directed(experiment: Experiment, joint: int) -> Array:
    """Direction of motion, and speed without it, in the analysis band (n_band, 2); zero for a joint that stands."""
    qd = experiment.motion.qd[:, joint]
    direction = np.tanh(qd / max(0.005 * np.max(np.abs(qd)), 1e-300))
    return experiment.motion.to_band(np.stack([direction, qd * direction], axis=1))


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
    made = replace(experiment, motion=replace(motion, **filtered, notes=(*motion.notes, note)), store={}, whole=None)
    made.store["bands"] = bands
    return made
