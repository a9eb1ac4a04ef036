"""What a capture is compared by: motion, turn, force and the size of its chatter, each over a quarter of a second.

How cables chatter on the pin depends on everything; what they push on average does not. So position and force are
averaged, and of the chatter only its size counts: the logarithm of the RMS of the force's 50 ms means about the
average. Letters: n quarters of a second, c channels.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .recording import EVERY, CaptureRecording, Track

Array = NDArray[np.float64]

SLOW = 5
"""Times of a track in a mean."""
QUARTER = SLOW * EVERY
"""[s] Between means."""
QUIET = 0.05
"""[N] Chatter below this is none."""


def slow_means(x: Array) -> Array:
    """Means over a quarter of a second (n, c) of columns (K, c)."""
    return x[: len(x) // SLOW * SLOW].reshape(-1, SLOW, x.shape[1]).mean(1)


def channels(capture: CaptureRecording) -> tuple[str, ...]:
    """Names: ``pos.<body>.<axis>``, ``turn.<body>.<axis>`` of one that turns, ``force.<sensor>.<axis>`` and
    ``chatter.<sensor>``."""
    names = [f"pos.{capture.body}.{a}" for a in "xyz"]
    if capture.setup.target.rotates:
        names += [f"turn.{capture.body}.{a}" for a in "xyz"]
    for sensor in capture.sensors.values():
        names += [*(f"force.{sensor}.{a}" for a in "xyz"), f"chatter.{sensor}"]
    return tuple(names)


def unit_of(channel: str) -> str:
    """Of a channel; chatter is a logarithm."""
    return {"pos": "m", "turn": "rad", "force": "N", "chatter": "1"}[channel.partition(".")[0]]


def shown(names: Sequence[str]) -> list[int]:
    """Channels that results and pictures show: motion and force; not turns, nor the logarithm of the chatter."""
    return [c for c, name in enumerate(names) if unit_of(name) in ("m", "N")]


def seen(capture: CaptureRecording, track: Track) -> Array:
    """A track's channels (n, c), as the capture has them; not a number where there are none."""
    parts = [slow_means(track.position)]
    if capture.setup.target.rotates:
        start = Rotation.from_quat(capture.setup.target.orientation, scalar_first=True).inv()
        known = np.isfinite(track.quaternion).all(1)
        turn = np.full((len(track.quaternion), 3), np.nan)
        turn[known] = (Rotation.from_quat(track.quaternion[known], scalar_first=True) * start).as_rotvec()
        parts.append(slow_means(turn))
    for body in capture.sensors:
        slow = slow_means(track.force[body])
        fast = track.force[body][: SLOW * len(slow)] - np.repeat(slow, SLOW, axis=0)
        size = np.sqrt(np.sum(fast**2, axis=1).reshape(-1, SLOW).mean(1))
        parts += [slow, np.log(np.hypot(size, QUIET + capture.noise[body]))[:, None]]
    return np.concatenate(parts, axis=1)


def times(capture: CaptureRecording) -> Array:
    """Middles of the quarters (n,) [s], on the recording's clock."""
    return slow_means(capture.times[:, None])[:, 0] + capture.zero


def motion(capture: CaptureRecording) -> Array:
    """What sizes are relative to (n, c): position since the start, and the other channels as they are measured."""
    x = seen(capture, capture.measured)
    x[:, :3] -= x[np.argmax(np.isfinite(x[:, :3]).all(1)), :3]
    return x
