"""Vibration that comes and goes: a residual far stronger at some times than at most others.

What a model leaves out goes with a state of the arm; a disturbance or a noise is as strong at one time as at another.
What does neither has no law in the joint's own motion to be named by: how much, when, and how fast is all there is to
say of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import periodogram

from ...models.floating.tree import n_carriers
from ...models.rig.rig import Rig
from ..fitting.experiment import Experiment
from ..fitting.fit import Fit
from .encoder_noise import UNEVEN, encoder_torque
from .locate import WINDOW
from .rest import bridged, in_motion

Array = NDArray[np.float64]

LOUD = 3.0
"""Times the ordinary mean square, of the median window and of what the encoders' noise leaves, from which on a window
is out of the ordinary: that noise goes with the pose, and with how fast an encoder's steps pass."""

LEAST = 0.2
"""Share of a channel's residual energy, above that of ordinary windows, that makes it bursts.

Something comes again if as much is left without the loudest window: what was there once, as a knock is, could not be
held to any law of the arm's.
"""

FEWEST = 12
"""Windows of which a median says something."""


@dataclass(frozen=True)
class Bursts:
    """Of one channel: the share of the residual's energy that is out of the ordinary, its frequency [Hz], and whether
    it comes again."""

    share: float
    frequency: float
    again: bool


def bursts(final: Fit, experiments: Sequence[Experiment]) -> dict[int, Bursts]:
    """Channels whose residual comes in bursts.

    Samples near rest are left out. On a suspension or a floating base every joint moves what carries the others, which
    rings as it likes; nothing is said there.
    """
    tree = experiments[0].body.tree
    if isinstance(tree, Rig) or n_carriers(tree):
        return {}
    moving = np.split(in_motion(experiments), np.cumsum([len(e.measured) for e in experiments])[:-1])
    residuals = [final.assembly.residual(bridged(e), final.theta)[0] for e in experiments]
    heard = np.mean([encoder_torque(final, e) ** 2 for e in experiments], axis=0)
    found = {}
    for c in range(residuals[0].shape[1]):
        strength, loudest = _windows(experiments, [r[:, c] for r in residuals], [m[:, c] for m in moving])
        usual = np.median(strength) + UNEVEN * heard[c] if len(strength) >= FEWEST else np.inf
        over = np.maximum(strength - LOUD * usual, 0.0)
        if (share := _share(over, strength)) > LEAST:
            once = np.argmax(strength)
            found[c] = Bursts(share, loudest, _share(np.delete(over, once), np.delete(strength, once)) > LEAST)
    return found


def _share(over: Array, strength: Array) -> float:
    return float(over.sum() / max(strength.sum(), 1e-300))


def _windows(
    experiments: Sequence[Experiment], residuals: Sequence[Array], moving: Sequence[NDArray[np.bool_]]
) -> tuple[Array, float]:
    """Mean square of the windows that are at least half in motion (n_windows,), and the loudest one's frequency."""
    found, parts = [], []
    for e, r, m in zip(experiments, residuals, moving, strict=True):
        rate = 2 * e.motion.band
        length = max(int(WINDOW * rate), 2)
        for k in range(0, len(r) - length + 1, length):
            own, on = r[k : k + length], m[k : k + length]
            if on.mean() >= 0.5:
                found.append(float(np.mean(own[on] ** 2)))
                parts.append((own, rate))
    if not found:
        return np.zeros(0), 0.0
    f, power = periodogram(*parts[int(np.argmax(found))], window="hann", nfft=1024)
    return np.array(found), float(f[np.argmax(power)])
