"""What the noise of a capture's channels depends on: before the first touch on sensors, then on laws of contact."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..nuisance.noise import NoiseChannel
from ..sources.source import Linearisation
from .recording import Track
from .seen import QUARTER, slow_means

Array = NDArray[np.float64]

DIFFER = {"pos": 2.5e-4, "turn": 4e-3, "force": 0.09, "chatter": 1.0}
"""What a simulation that is right is off by at least, once cables touch: position [m], turn [rad], share of the force,
ln(chatter). Rods in MuJoCo and this snare differ by so much on a hard pin, where cables bounce."""


def touched(track: Track) -> NDArray[np.bool_]:
    """Quarters of a second (n,) from the first touch of a simulation on."""
    return np.maximum.accumulate(np.any(slow_means(np.abs(track.force["target"])) > 0, axis=1))


def noise_channels(
    names: Sequence[str],
    tracks: Sequence[Track | None],
    linear: Linearisation,
    could: Sequence[Sequence[Array]],
    scale: Array,
) -> list[list[NoiseChannel]]:
    """What the noise of every channel depends on.

    Once cables touch the pin no law of contact tells motion and force to what a sensor does: a channel may then be off,
    as a joint near rest may hold any torque, by what nothing explains there, in the RMS, and by what engines that are
    both right differ by at least.

    Parameters
    ----------
    names : sequence of str
        Channels.
    tracks : sequence of Track
        Simulations of each recording.
    linear : Linearisation
        Their residuals.
    could : sequence of sequence of array (n, k)
        What could explain each channel's of each.
    scale : array (c,)
    """
    rows = [np.zeros(len(r), bool) if t is None else touched(t)[: len(r)]
            for t, r in zip(tracks, linear.residuals, strict=True)]  # fmt: skip
    found: list[list[NoiseChannel]] = [[] for _ in rows]
    for c, name in enumerate(names):
        left = np.concatenate([r[k, c] for r, k in zip(linear.residuals, rows, strict=True)])
        columns = np.concatenate([x[k] for x, k in zip(could[c], rows, strict=True)])
        kind = name.partition(".")[0]
        level = DIFFER[kind] * (scale[c] if kind == "force" else 1.0)
        if len(left) > 2 * columns.shape[1]:
            left = left - columns @ np.linalg.lstsq(columns, left, rcond=1e-6)[0]
            level = max(level, float(np.sqrt(left @ left / (len(left) - columns.shape[1]))))
        for own, k in zip(found, rows, strict=True):
            n = len(k)
            own.append(NoiseChannel(QUARTER, (slice(0, n),), np.zeros(n), (k.astype(float),), np.zeros(n), level))
    return found
