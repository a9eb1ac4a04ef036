"""What is drawn of the KR 300 study, and the pattern that its encoders differ by once all that has a name is gone."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..identification.links.source import Links, start
from ..models.model import Model
from ..report.drawing import AFTER, BEFORE, GREY, drawing, line, margins, svg
from ..report.time_axes import over_time

Array = NDArray[np.float64]
Left = tuple[Array, Array, Array]
"""Time [s], link position [rad], what is left of the encoders' difference [rad], each (n,)."""

MDEG = np.degrees(1e3)
"""[mdeg/rad]"""

MOST_CYCLES = 2000
"""Cycles per turn tried; at 25°/s and 250 samples a second more would alias."""


def left_over(links: Links, numbers: Sequence[int], model: Model | None) -> list[Left]:
    """Unfiltered difference of one axis' encoders in some recordings, less what a model says of it and less its own
    mean."""
    found, at = [], None if model is None else start(links, model)
    for i in numbers:
        run = links.rows[i][0]
        difference = run.motion.tau[:, run.joint]
        link = run.motion.q[:, run.joint] + difference
        if at is not None:
            difference = difference - sum(run.term(p, at.of_effect(p))[0] for p in at.placed)
        found.append((run.motion.time, link, difference - np.mean(difference)))
    return found


def rms(parts: Sequence[Left]) -> float:
    """RMS of the remaining residual, all recordings together [mdeg]."""
    return float(MDEG * np.sqrt(np.mean(np.concatenate([x for _, _, x in parts]) ** 2)))


def pattern(parts: Sequence[Left]) -> tuple[int, complex]:
    """Cycles per turn of the sine in link position that explains most, and its complex amplitude [rad]."""
    angle, rest = (np.concatenate([x[i] for x in parts]) for i in (1, 2))
    turns = np.exp(-1j * angle)
    power, wave = np.zeros(MOST_CYCLES), np.ones_like(turns)
    for cycles in range(1, MOST_CYCLES):
        wave *= turns
        power[cycles] = abs(wave @ rest)
    # Slow waves over the travel are no pattern: the travel must hold at least ten of them.
    power[: int(10 * 2 * np.pi / np.ptp(angle))] = 0.0
    best = int(np.argmax(power))
    return best, complex(2 * np.mean(np.exp(-1j * best * angle) * rest))


def without(parts: Sequence[Left], cycles: int, amplitude: complex) -> list[Left]:
    """What is left with a pattern taken out."""
    return [(t, q, x - (amplitude * np.exp(1j * cycles * q)).real) for t, q, x in parts]


def differences(axes: Sequence[str], before: Sequence[Left], after: Sequence[Left]) -> bytes:
    """How the encoders of each axis differ on the held-out recording: as recorded, and with what was named."""
    with drawing():
        figure = Figure(figsize=(10.0, 0.9 + 1.6 * len(axes)))
        strips = figure.subplots(len(axes), sharex=True, squeeze=False)[:, 0]
        figure.subplots_adjust(**margins(figure, 0.75, 0.15, 0.5, 0.45), hspace=0.4)
        for strip, axis, old, new in zip(strips, axes, before, after, strict=True):
            strip.axhline(0, color=GREY, linewidth=0.6)
            line(strip, old[0], MDEG * old[2], BEFORE, 1.0, "as recorded")
            line(strip, new[0], MDEG * new[2], AFTER, 1.0, "with what was named")
            over_time(strip, f"{axis}, run C")
            strip.set_title(f"link less motor position, {axis}, run C")
            strip.set_ylabel("difference [mdeg]")
        strips[-1].set_xlabel("time [s]")
        figure.legend(*strips[0].get_legend_handles_labels(), loc="upper right", ncols=2)
        return svg(figure)
