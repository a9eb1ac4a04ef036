"""Effects of a capture fitted with the simulation in the loop.

Steps are Gauss and Newton's on the log-likelihood L of `comparison`, with derivatives by differences over steps so wide
that chatter does not rule them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.model import PlacedEffect
from ..fitting.least_squares import NormalEquations, bounded_step
from .comparison import Blocks, likelihood, residual, variances
from .handles import bounds, free, handle_of, steps, values_of
from .recording import CaptureRecording, Track
from .sets import CaptureSet

Array = NDArray[np.float64]
Slopes = tuple[tuple[Blocks, ...], ...]

DAMPING = 1e-2
"""Of a step, as a share of each parameter's own curvature: what looks alike does not run off against each other."""
STRIDE = 8.0
"""Most that a parameter moves in one step, in units of its difference."""
SHRUNK, SHRINKAGE = 0.4, 0.2
"""A step is tried whole and shortened to this; where both lose, the stride shrinks by the second."""
STILL = 0.02
"""A step shorter than this, in units of the differences, ends a fit."""
SETTLED = 0.3
"""A step that gains less of the log-likelihood ends a fit."""


@dataclass(frozen=True)
class CaptureFit:
    """Effects, their handles x (P,), and the likelihood of a set of captures with them.

    ``likelihood`` is L, −inf where a capture cannot be simulated; ``tracks`` and ``residuals`` are then empty.
    ``residuals`` holds each capture's blocks by name, ``slopes`` the derivatives of these by each handle: P tuples of
    one mapping a capture, None where they were not asked for.
    """

    placed: tuple[PlacedEffect, ...]
    x: Array
    likelihood: float
    tracks: tuple[Track, ...]
    residuals: tuple[Blocks, ...]
    slopes: Slopes | None = None

    @property
    def values(self) -> dict[str, float]:
        """Parameters by ``effect.place.parameter``."""
        return values_of(self.placed, self.x)


def evaluate(captures: CaptureSet, placed: Sequence[PlacedEffect], many: Sequence[Array]) -> list[CaptureFit]:
    """Simulate at many places (P,) of the handles; L is −inf where a capture cannot be."""
    found = []
    for x, tracks in zip(many, captures.tracks_at([values_of(placed, x) for x in many]), strict=True):
        whole = tuple(t for t in tracks if t is not None and np.all(np.isfinite(t.position)))
        if len(whole) < len(tracks):
            found.append(CaptureFit(tuple(placed), x, -np.inf, (), ()))
            continue
        residuals = tuple(residual(c, t) for c, t in zip(captures.captures, whole, strict=True))
        found.append(CaptureFit(tuple(placed), x, likelihood(captures.captures, residuals), whole, residuals))
    return found


def started(captures: CaptureSet, placed: Sequence[PlacedEffect], x: Array) -> CaptureFit:
    """A start for `fit`, inside the bounds but for what is held."""
    return evaluate(captures, placed, [np.where(free(placed), np.clip(x, *bounds(placed)), x)])[0]


def with_slopes(captures: CaptureSet, at: CaptureFit) -> CaptureFit:
    """This fit with derivatives by the handles: one forward difference each (backward at the upper bound), 0 where the
    capture cannot be simulated."""
    _, high = bounds(at.placed)
    step = steps(at.placed)
    step = np.where(at.x + step > high, -step, step)
    slopes = []
    for there, size in zip(evaluate(captures, at.placed, [*(at.x + np.diag(step))]), step, strict=True):
        ends = there.residuals or at.residuals
        pairs = zip(at.residuals, ends, strict=True)
        slopes.append(tuple({name: (b[name] - a[name]) / size for name in a} for a, b in pairs))
    return replace(at, slopes=tuple(slopes))


def normal(captures: Sequence[CaptureRecording], at: CaptureFit) -> tuple[Array, Array]:
    """Gradient (P,) and normal matrix (P, P) of −L by Gauss and Newton, scales as they are."""
    assert at.slopes is not None
    gradient, matrix = np.zeros(len(at.x)), np.zeros((len(at.x), len(at.x)))
    if not len(at.x):
        return gradient, matrix
    for name, variance in variances(captures, at.residuals).items():
        for c, own in enumerate(at.residuals):
            columns = np.stack([s[c][name].ravel() for s in at.slopes], axis=1)
            gradient += 1 / variance * columns.T @ own[name].ravel()
            matrix += 1 / variance * columns.T @ columns
    return gradient, matrix


def step_from(captures: Sequence[CaptureRecording], at: CaptureFit, stride: Array) -> tuple[Array, float]:
    """Step of the handles (P,), at most ``stride`` (P,) each and inside the bounds, and how much of L it should gain.

    What is held stays.
    """
    gradient, matrix = normal(captures, at)
    low, high = bounds(at.placed)
    size = np.where(free(at.placed), np.sqrt(np.diag(matrix)), 0.0)
    room = np.maximum(low - at.x, -stride), np.minimum(high - at.x, stride)
    move = bounded_step(NormalEquations(0.0, gradient, matrix), size, DAMPING, *room)
    return move, -float(gradient @ move + 0.5 * move @ matrix @ move)


def fit(captures: CaptureSet, start: CaptureFit, most: int = 4) -> CaptureFit:
    """Maximise L from a start.

    Derivatives are taken once, where the start has none, and then follow the steps by Broyden's update (1965).

    Parameters
    ----------
    captures : CaptureSet
    start : CaptureFit
        Effects that hold their parameter are simulated with it and not moved.
    most : int
        Most steps.
    """
    if not np.isfinite(start.likelihood):
        return start
    here = start if start.slopes is not None else with_slopes(captures, start)
    step = steps(start.placed)
    stride = STRIDE * step
    for _ in range(most if free(start.placed).any() else 0):
        move, _ = step_from(captures.captures, here, stride)
        if np.all(np.abs(move) < STILL * step):
            break
        whole, short = evaluate(captures, start.placed, [here.x + share * move for share in (1.0, SHRUNK)])
        best = max(whole, short, key=lambda f: f.likelihood)
        gained = best.likelihood - here.likelihood
        if gained > 0:
            here = replace(best, slopes=_broyden(here, best, step))
        elif short.residuals:
            here, stride = replace(here, slopes=_broyden(here, short, step)), SHRINKAGE * stride
        if 0 <= gained < SETTLED:
            break
    return here


def _broyden(here: CaptureFit, there: CaptureFit, step: Array) -> Slopes:
    """Derivatives that agree with a step that was taken: the least change, lengths in units of the differences."""
    assert here.slopes is not None
    move = there.x - here.x
    share = move / step**2 / max(float(np.sum((move / step) ** 2)), 1e-300)
    made: list[list[dict[str, Array]]] = [[] for _ in move]
    for c, (a, b) in enumerate(zip(here.residuals, there.residuals, strict=True)):
        forecast = {name: sum(own[c][name] * m for own, m in zip(here.slopes, move, strict=True)) for name in a}
        miss = {name: b[name] - a[name] - forecast[name] for name in a}
        for k, own in enumerate(here.slopes):
            made[k].append({name: own[c][name] + miss[name] * share[k] for name in a})
    return tuple(tuple(m) for m in made)


def spread(captures: Sequence[CaptureRecording], at: CaptureFit) -> Array:
    """Standard deviation of each parameter's value (P,); inf where the recordings say nothing."""
    _, matrix = normal(captures, at)
    size = np.sqrt(np.diag(matrix))
    known = size > 0
    result = np.full(len(size), np.inf)
    if known.any():
        unit = matrix[np.ix_(known, known)] / np.outer(size[known], size[known])
        result[known] = np.sqrt(np.maximum(np.diag(np.linalg.pinv(unit, rcond=1e-10)), 0)) / size[known]
    slopes = [handle_of(p).slope(float(x)) for p, x in zip(at.placed, at.x, strict=True)]
    return result * np.array(slopes, float)
