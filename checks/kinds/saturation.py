"""A torque that is cut off at a level: its sensor, or what logs it, goes no further."""

import numpy as np

from ..case import Case
from ..finding import Finding, Kind

LEAST = 0.005
"""Share of samples at the level from which on it is looked at."""

BEYOND = 0.6
"""Share of samples at the level at which the model's torque must lie beyond it, and by a tenth of it on average."""


def find(case: Case) -> list[Finding]:
    """Channels of which samples stand at one largest value while the fitted model goes beyond it.

    A drive that is at its limit delivers that torque, and the motion shows it: the model then agrees.
    """
    if not case.comparable:
        return []
    found, fitted = [], case.given
    samples = case.samples
    for c, joint in enumerate(case.joints):
        tau = np.concatenate([d[f"tau.{joint}"].to_numpy() for d in case.datasets if f"tau.{joint}" in d])
        tau = tau[np.isfinite(tau)]
        for level, words in _levels(tau):
            sign = np.sign(level)
            rms = np.sqrt(np.mean(samples.tau[:, c] ** 2))
            at = np.abs(samples.tau[:, c] - level) < 0.01 * abs(level)
            if at.sum() < 5 or case.grounds.counted[c] == 0:
                continue
            over = -sign * fitted.residual[at, c] * rms  # model less measured, outwards
            if np.mean(over > 0) > BEYOND and np.mean(over) > 0.1 * abs(level):
                effort = case.tree.joints[c].effort
                limit = f"; the URDF's effort limit is {effort:g}" if np.isfinite(effort) else ""
                found.append(
                    Finding(
                        "saturation",
                        f"tau.{joint}",
                        0.97,
                        f"tau.{joint} stands at {level:.4g} in {words} of all samples, and the model goes "
                        f"{np.mean(over):.3g} beyond on average: the channel is cut off there{limit}",
                        f'limits = {{ "tau.{joint}" = {abs(level):.6g} }}',
                    )
                )
                break
    return found


def _levels(tau: np.ndarray) -> list[tuple[float, str]]:
    """Largest and smallest value, where `LEAST` of the samples and three in a row stand at it."""
    found = []
    for level in (float(tau.max(initial=0.0)), float(tau.min(initial=0.0))):
        if level == 0:
            continue
        at = np.abs(tau - level) <= 1e-6 * abs(level)
        if np.mean(at) > LEAST and (at[2:] & at[1:-1] & at[:-2]).any():
            found.append((level, f"{100 * np.mean(at):.2g} %"))
    return found


KIND = Kind("saturation", "a torque is cut off at a level", find=find)
