"""How a simulated capture is compared with a recording, and the likelihood of that recording.

What is compared comes in blocks: position and force averaged over a quarter of a second, and the logarithm of the
force's chatter over half a second (RMS of its 50 ms means about those averages). A block's scale is not known
beforehand: engines, meshes and contact laws differ by more than sensors do. With the scales left free the
log-likelihood is, up to a constant (Beck and Arnold 1977),

    L = −½ Σ_b n_b ln(RSS_b/n_b + f_b²),

f_b the least that sensors scatter and engines differ by. n_b counts independent numbers: neighbours in time have
similar errors.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .recording import EVERY, CaptureRecording, Track

Array = NDArray[np.float64]
Blocks = Mapping[str, Array]
"""One capture's numbers, (n, c) arrays: ``position`` [m], ``turn`` [rad], ``slow.<body>`` [N], ``chatter.<body>``."""

SLOW, LONG = 5, 10
"""Times of a track in a slow mean (0.25 s), and in a number for the chatter (0.5 s)."""
QUARTER = SLOW * EVERY
"""[s] Between slow means."""
NEWS = 0.25
"""Share of the numbers that counts: of four neighbours in time, which miss alike, one is news."""
LEAST = {"position": 1.5e-4, "turn": 4e-3, "slow": 0.05, "chatter": 0.15}
"""What engines that are both right differ by at least: position [m], orientation [rad], force [N], ln(chatter). Rods in
MuJoCo under a smooth skin and this snare do by 0.15 mm on a soft pin; on a hard one, where cables bounce, by more, as
the residual itself then says. Less than that is no physics left out."""
LEAST_SHARE = 0.02
"""Least difference of forces, as a share of their RMS; rods and this snare: 0.02 on a soft pin, 0.09 on a hard one."""
QUIET = 0.05
"""[N] Chatter below this is none."""


def slow_means(x: Array) -> Array:
    """Means over a quarter of a second (K // 5, c) of columns (K, c)."""
    return x[: len(x) // SLOW * SLOW].reshape(-1, SLOW, x.shape[1]).mean(1)


def blocks(capture: CaptureRecording, track: Track) -> dict[str, Array]:
    """The blocks of a track that are compared."""
    found = {"position": slow_means(track.position)}
    if capture.setup.target.rotates:
        start = Rotation.from_quat(capture.setup.target.orientation, scalar_first=True).inv()
        known = np.isfinite(track.quaternion).all(1)
        turn = np.full((len(track.quaternion), 3), np.nan)
        turn[known] = (Rotation.from_quat(track.quaternion[known], scalar_first=True) * start).as_rotvec()
        found["turn"] = slow_means(turn)
    for body in capture.sensors:
        force = track.force[body]
        slow = slow_means(force)
        fast = np.sum((force[: SLOW * len(slow)] - np.repeat(slow, SLOW, axis=0)) ** 2, axis=1)
        size = np.sqrt(fast[: len(fast) // LONG * LONG].reshape(-1, LONG).mean(1))
        found[f"slow.{body}"] = slow
        found[f"chatter.{body}"] = np.log(np.hypot(size, QUIET + capture.noise[body]))[:, None]
    return found


def residual(capture: CaptureRecording, track: Track) -> dict[str, Array]:
    """Measurement less simulation, by block; 0 where nothing was measured."""
    ours, theirs = blocks(capture, track), blocks(capture, capture.measured)
    return {name: np.nan_to_num(theirs[name] - ours[name]) for name in theirs}


def floor(capture: CaptureRecording, name: str) -> float:
    """f_b: the least that a block's numbers count for."""
    kind, _, body = name.partition(".")
    noise = capture.noise[body or kind] if kind in ("position", "slow") else 0.0
    carried = LEAST_SHARE * capture.carried[body] if kind == "slow" else 0.0
    return float(np.hypot(LEAST[kind] + carried, noise / SLOW**0.5))


def scales(captures: Sequence[CaptureRecording], residuals: Sequence[Blocks]) -> dict[str, tuple[int, float]]:
    """Numbers in a block of all captures together, and their variance with the floor."""
    found = {}
    for name in residuals[0]:
        every = [(r[name], floor(c, name)) for c, r in zip(captures, residuals, strict=True)]
        size = sum(x.size for x, _ in every)
        found[name] = (size, sum(float(np.sum(x**2)) + x.size * f * f for x, f in every) / size)
    return found


def variances(captures: Sequence[CaptureRecording], residuals: Sequence[Blocks]) -> dict[str, float]:
    """What squares of a block's numbers are divided by, so that ½ of their sum is in units of the log-likelihood."""
    return {name: variance / NEWS for name, (_, variance) in scales(captures, residuals).items()}


def likelihood(captures: Sequence[CaptureRecording], residuals: Sequence[Blocks]) -> float:
    """L of residuals; a block's scale is one for all captures."""
    return float(sum(-0.5 * NEWS * n * np.log(v) for n, v in scales(captures, residuals).values()))


def price(residuals: Sequence[Blocks]) -> float:
    """Price of a parameter in L: ½ ln of the independent numbers (Schwarz 1978)."""
    return float(0.5 * np.log(NEWS * sum(x.size for own in residuals for x in own.values())))
