"""A torque that is cut off at a level: its sensor, or what logs it, goes no further."""

import numpy as np

from ....report.words import percent
from ..case import CheckCase
from ..finding import CheckFinding, Kind
from ..reading import as_read

LEAST = 0.005
"""Share of samples at the level from which on it is looked at."""

BEYOND, CLEARLY = 0.65, 2.0
"""Share of samples at the level at which the model's torque must lie beyond it; and how many times what it misses
elsewhere, on average. Filters smear the edges of what is cut off, so that not all lie beyond."""

REST = 0.3
"""Share of samples that must stand below the level: the model is fitted to those."""


def find(case: CheckCase) -> list[CheckFinding]:
    """Channels of which samples stand at one largest value while the model, fitted to the others, goes beyond it.

    A drive that is at its limit delivers that torque, and the motion shows it: the model then agrees.
    """
    if not case.comparable:
        return []
    found, tau = [], case.samples.tau
    for c, joint in enumerate(case.joints):
        levels = _levels(case, f"tau.{joint}")
        # filters smear the edges: what comes near the level may have been cut, too
        near = [(level, of & (tau[:, c] / level > 0.9)) for level, _, of in levels]
        cut = np.any([at for _, at in near], axis=0) if near else np.zeros(len(tau), bool)
        if cut.sum() < 5 or np.mean(~cut) < REST or case.grounds.counted[c] == 0:
            continue
        without = np.zeros(tau.shape, bool)
        without[:, c] = cut
        fitted = case.grounds.fit(as_read(len(case.joints)), without=without)
        missed = fitted.residual[:, c] * np.sqrt(np.mean(tau[:, c] ** 2))
        elsewhere = np.sqrt(np.mean(missed[~cut] ** 2))
        over = np.concatenate([-np.sign(level) * missed[of & (tau[:, c] / level > 0.99)] for level, _, of in levels])
        if len(over) < 5 or np.mean(over > 0) < BEYOND or np.mean(over) < CLEARLY * elsewhere:
            continue
        # of recordings with a level each, the lowest leaves out what is cut off in all of them
        level, share = min(abs(level) for level, *_ in levels), sum(share for _, share, _ in levels)
        effort = case.tree.joints[c].effort
        limit = f"; the URDF's effort limit is {effort:g}" if np.isfinite(effort) else ""
        text = (
            f"tau.{joint} stands at {level:.4g} in {percent(share)} of all samples, and the model fitted to the "
            f"others goes {np.mean(over):.3g} beyond on average: the channel is cut off there{limit}"
        )
        mend = f'limits = {{ "tau.{joint}" = {level:.6g} }}'
        found.append(CheckFinding("saturation", f"tau.{joint}", 0.97, text, mend))
    return found


def _levels(case: CheckCase, channel: str) -> list[tuple[float, float, np.ndarray]]:
    """Largest and smallest value of a channel in each recording, where `LEAST` of its samples and three in a row stand
    at it; their share of all recordings' samples; and which of the case's samples are that recording's."""
    found, paths = [], [str(e.motion.path) for e in case.experiments]
    columns = [(str(d.attrs["path"]), d[channel].to_numpy()) for d in case.datasets if channel in d]
    whole = sum(len(column) for _, column in columns)
    for path, column in columns:
        own = np.isin(case.samples.run, [k for k, other in enumerate(paths) if other == path])
        tau = column[np.isfinite(column)]
        for level in (float(tau.max(initial=0.0)), float(tau.min(initial=0.0))):
            at = np.abs(tau - level) <= 1e-6 * abs(level)
            if level != 0 and np.mean(at) > LEAST and (at[2:] & at[1:-1] & at[:-2]).any():
                found.append((level, float(np.sum(at)) / whole, own))
    return found


KIND = Kind("saturation", "a torque is cut off at a level", find=find)
