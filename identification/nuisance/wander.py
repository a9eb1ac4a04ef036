"""A level that wanders: a torque, of cables, heat or grease, that drifts over seconds.

    K = v² e^(-|d|/τ), τ one of `WANDER_TIMES`

Its level has an exponential prior, and that it is there at all has the odds of nameless physics (Simpson et al. 2017).
It is learnt from means over blocks of time: what is faster is white there.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..deciding import WANDER_PRIOR, WANDER_TIMES
from .likelihood import Cost, Part, lowest
from .noise import Noise, NoiseChannel

Array = NDArray[np.float64]

AVERAGED = 0.25
"""[s] Blocks whose means the wander is learnt from."""


def level_and_time(
    residuals: Sequence[Array],
    columns: Sequence[Array],
    runs: Sequence[NoiseChannel],
    fast: Noise,
    freely: bool,
    odds: float,
) -> tuple[float, float]:
    """Level [T] and correlation time [s] of a wander beside the ``fast`` noise, zero where none is likelier; ``odds``
    are its prior odds, other arguments as in `learn.learn`."""
    whole = np.concatenate(list(residuals))
    size, most = float(np.std(whole)) + 1e-12, float(np.sqrt(np.mean(whole**2))) + 1e-12
    cost = Cost([averaged_over(r, c, run) for r, c, run in zip(residuals, columns, runs, strict=True)])
    own = slice(0, 2 if freely else 3)
    start, wide = np.log(np.array([0.3, 0.1]) * size)[: 1 if freely else 2], np.array([1.5, 2.0])[: 1 if freely else 2]

    def still(x: Array) -> float:
        noise = replace(fast, white=float(np.exp(x[0])) + 1e-3 * size, wander=0.0, settling=0.0)
        return cost(noise, most if freely else float(np.exp(x[1])))

    x = lowest(still, start, wide, start - 6, start + 3)
    best = (still(x) + float(np.log(odds)), 0.0, WANDER_TIMES[0])
    for time in WANDER_TIMES:

        def slow(x: Array, time: float = time) -> tuple[Noise, float]:
            white, wander = np.exp(x[:2])
            spread = most if freely else float(np.exp(x[2]))
            scales = {"white": float(white) + 1e-3 * size, "wander": float(wander), "wander_time": time}
            return replace(fast, settling=0.0, **scales), spread

        def penalised(x: Array, slow: Callable[[Array], tuple[Noise, float]] = slow) -> float:
            return cost(*slow(x)) + WANDER_PRIOR * float(np.exp(x[1])) / size

        for level in (0.01, 0.4):
            start = np.log(np.array([0.3, level, 0.1]) * size)[own]
            x = lowest(penalised, start, np.array([1.5, 10.0, 2.0])[own], start - 6, start + 3)
            best = min(best, (penalised(x), float(np.exp(x[1])), time))
    return best[1], best[2]


def averaged_over(residual: Array, columns: Array, run: NoiseChannel) -> Part:
    """Means over blocks of `AVERAGED` seconds: what is faster becomes white."""
    length = max(int(AVERAGED / run.step), 1)
    starts, segments, count = [], [], 0
    for s in run.segments:
        own = np.arange(s.start, s.stop - length + 1, length)
        starts.append(own)
        segments.append(slice(count, count + len(own)))
        count += len(own)
    rows = np.concatenate(starts)[:, None] + np.arange(length)
    sticks, settles = tuple(x[rows].mean(axis=1) for x in run.sticks), run.settles[rows].mean(axis=1)
    wanders = run.wanders[rows].mean(axis=1) if isinstance(run.wanders, np.ndarray) else run.wanders
    other = NoiseChannel(run.step * length, tuple(segments), np.zeros(count), sticks, settles, run.level, wanders)
    return np.column_stack([residual[rows].mean(axis=1), columns[rows].mean(axis=1)]), other
