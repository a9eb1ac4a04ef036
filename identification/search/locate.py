"""Where the misfit lies: which channel, when, and in which condition of motion."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.floating.tree import channel
from ...report.words import percent
from ..diagnosis import Location
from ..fitting.experiment import Experiment

Array = NDArray[np.float64]

WINDOW = 0.5
"""[s] Grain of the time windows."""

SHOWN = 0.5
"""The windows named hold this share of a channel's explained energy."""

MOST_WINDOWS = 6


def locate(experiments: Sequence[Experiment], explained: Sequence[Array]) -> tuple[Location, ...]:
    """Channels by their share of the misfit, with time windows of the first recording, and a condition of motion.

    Parameters
    ----------
    experiments : sequence of Experiment
        Training recordings.
    explained : sequence of array (n_band, J)
        Of each recording: the torque that the added physics makes, or the residual that has no name.

    Energies are shares of each channel's measured energy, so that newtons and newton metres compare.
    """
    energy = np.sum(np.concatenate(list(explained)) ** 2, axis=0)
    measured = np.sum(np.concatenate([e.measured for e in experiments]) ** 2, axis=0)
    weight = energy / np.maximum(measured, 1e-300)
    total = weight.sum()
    if total <= 0:
        return ()
    found = []
    for c in np.argsort(-weight):
        share = float(weight[c] / total) * (1 - 1e-12)  # so that rounding adds up to 1 at most
        if share < 0.01:
            break
        windows = _windows(experiments[0], explained[0][:, c])
        name = channel(experiments[0].body.tree, int(c))
        found.append(Location(name, share, windows, _state(experiments, explained, c)))
    return tuple(found)


def _windows(experiment: Experiment, change: Array) -> tuple[tuple[float, float], ...]:
    """Time windows that hold the strongest half of a channel's change, neighbours merged."""
    time = experiment.motion.to_band(experiment.motion.time)
    number = ((time - time[0]) / WINDOW).astype(int)
    energy = np.bincount(number, change**2)
    if not energy.any():
        return ()
    order = np.argsort(-energy)
    count = int(np.searchsorted(np.cumsum(energy[order]), SHOWN * energy.sum())) + 1
    chosen = np.zeros(len(energy) + 2, bool)
    chosen[order[:count] + 1] = True
    edges = np.flatnonzero(np.diff(chosen.astype(int)))
    spans = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    spans.sort(key=lambda s: -energy[s[0] : s[1]].sum())
    kept = sorted(spans[:MOST_WINDOWS])
    return tuple(
        (round(float(time[0] + a * WINDOW), 3), round(float(min(time[0] + b * WINDOW, time[-1])), 3)) for a, b in kept
    )


def _state(experiments: Sequence[Experiment], changed: Sequence[Array], c: int) -> str:
    """The one condition on the joint's own motion that best concentrates the change: at least a third above its
    share."""
    joint = experiments[0].motion.joints[c]
    unit = "m/s" if experiments[0].body.tree.joints[c].kind == "prismatic" else "rad/s"
    place = unit[:-2]
    torque = "N" if place == "m" else "N*m"
    energy = np.concatenate([x[:, c] ** 2 for x in changed])

    def whole(name: str) -> Array:
        return np.concatenate([e.motion.to_band(getattr(e.motion, name)[:, c]) for e in experiments])

    q, qd, qdd, tau = whole("q"), whole("qd"), whole("qdd"), whole("tau")
    options: list[tuple[str, NDArray[np.bool_]]] = [
        (f"qd.{joint} > 0", qd > 0),
        (f"qd.{joint} < 0", qd < 0),
        (f"|qd.{joint}| within 5 % of rest, reversing or starting", np.abs(qd) < 0.05 * np.abs(qd).max()),
    ]
    for label, x, u in (
        (f"|qd.{joint}|", np.abs(qd), unit),
        (f"|qdd.{joint}|", np.abs(qdd), unit + "^2"),
        (f"|{channel(experiments[0].body.tree, c)}|", np.abs(tau), torque),
        (f"q.{joint}", q, place),
    ):
        for level in np.quantile(x, [0.25, 0.5, 0.75]):
            options.append((f"{label} > {level:.3g} {u}", x > level))
            options.append((f"{label} < {level:.3g} {u}", x < level))
    best, text = 0.0, "throughout the motion"
    for label, mask in options:
        size = float(np.mean(mask))
        if 0.02 < size < 0.9:
            share = float(energy[mask].sum() / max(energy.sum(), 1e-300))
            # What a condition gains in energy over chance, so that tiny and near-total sets both lose.
            if share > 1.33 * size and share - size > best:
                best, text = share - size, f"{label} ({percent(share)} of it, in {percent(size)} of the time)"
    return text
