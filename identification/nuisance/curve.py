"""A nameless curve over one or two coordinates of a joint.

A Gaussian process with the squared-exponential kernel in the Hilbert-space basis of Solin and Särkkä (2020): sines over
the coordinate's range, weighted by the kernel's spectral density at their frequency, so that the curve has unit
variance and its length scale is a share of the range. Over two coordinates the basis is the product of the two.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...recordings.condition import Motion
from ..fitting.assembly import TorqueEvaluation
from ..fitting.experiment import Experiment

Array = NDArray[np.float64]

BEYOND = 1.25
"""Half-width of the basis, in half ranges of the coordinate."""

TURNING = 0.006
"""Share of the peak speed over which the direction of motion changes its sign."""

SHORTEST = 1e-3
"""Share of the travel, or of the peak speed, from which on a distance since a reversal, or a speed, is told apart on a
logarithmic scale."""

NEIGHBOURS = 3
"""Other joints, the nearest first, whose coordinates a curve may run over."""


@dataclass(frozen=True)
class Coordinates:
    """Signals of one recording that a joint's curve may run over, each (n,), and of all joints (n, J)."""

    q: Array
    qd: Array
    load: Array
    direction: Array
    speed: Array
    time: Array
    path: Array
    driving: Array
    turned: Array

    @staticmethod
    def of(experiment: Experiment, state: TorqueEvaluation, joint: int, peak: float, travel: float) -> "Coordinates":
        """Coordinates of a joint, with its peak speed and travel over the training recordings."""
        return Coordinates.along(experiment.motion, state.load[:, joint], joint, peak, travel)

    @staticmethod
    def along(m: Motion, load: Array, joint: int, peak: float, travel: float) -> "Coordinates":
        """Coordinates of a joint along a motion, given its load (n,)."""
        speed = m.qd[:, joint]
        power = load * speed
        return Coordinates(
            m.q,
            m.qd,
            load,
            np.tanh(speed / (TURNING * peak)),
            speed / peak,
            m.time - m.time[0],
            np.concatenate([np.cumsum(np.abs(speed[s])) * m.period for s in m.segments]),
            0.5 * (1 + np.tanh(3 * power / max(float(np.std(power)), 1e-300))),
            np.log10(1 + _since_turning(speed, m.segments, m.period) / max(SHORTEST * travel, 1e-300)),
        )


def _since_turning(speed: Array, segments: Sequence[slice], period: float) -> Array:
    """Distance travelled since the last reversal, or since the start of a run without a gap (n,)."""
    found = np.zeros(len(speed))
    for s in segments:
        own = speed[s]
        gone = np.cumsum(np.abs(own)) * period
        turns = np.flatnonzero(np.diff(np.sign(own)) != 0) + 1
        last = np.zeros(len(own), int)
        last[turns] = turns
        found[s] = gone - gone[np.maximum.accumulate(last)]
    return found


@dataclass(frozen=True)
class NuisanceCurve:
    """One curve of the family: its coordinates in words, and its columns (n, k) along a recording."""

    words: str
    columns: Callable[[Coordinates], Array]


def basis(x: Array, low: float, high: float, length: float, order: int) -> Array:
    """Sines over [low, high] with their prior deviations (n, order); ``length``: the kernel's, as a share of it."""
    u = 2 * (x - low) / max(high - low, 1e-12) - 1
    w = np.pi * np.arange(1, order + 1) / (2 * BEYOND)
    density = np.exp(-0.5 * (2 * length * w) ** 2)
    return np.sin(w * (np.clip(u, -1.2, 1.2)[:, None] + BEYOND)) * np.sqrt(2 * density / density.sum())


def over_decades(x: Coordinates) -> Array:
    """A curve of unit variance over the speed, on a logarithmic scale, by direction (n, k)."""
    decades = np.log10(1 + np.abs(x.speed) / SHORTEST)
    return basis(decades, 0.0, float(np.log10(1 + 1 / SHORTEST)), 0.2, 8) * x.direction[:, None]


SMALL = ("position", "position by direction", "speed by direction", "load", "load by direction")
"""Curves of the family that no law of a joint is free of: small ones stand beside every explanation."""


def family(joint: int, names: Sequence[str], training: Sequence[Coordinates], alone: bool) -> list[NuisanceCurve]:
    """Every curve that a joint's channel may have.

    Parameters
    ----------
    joint : int
    names : sequence of str
        Of all joints.
    training : sequence of Coordinates
        Of the training recordings: ranges are theirs.
    alone : bool
        Only over the joint's own coordinates.
    """
    reach = _Ranges(training)

    def q(of: int = joint) -> Callable[[Coordinates], Array]:
        return lambda x: x.q[:, of]

    def fast(x: Coordinates) -> Array:
        return np.abs(x.speed)

    def load(x: Coordinates) -> Array:
        return x.load

    def forth(x: Coordinates) -> Array:
        return x.direction

    def speed(x: Coordinates) -> Array:
        return x.speed

    own = [
        reach.curve("position", q(), 0.25, 8),
        reach.curve("position, narrow", q(), 0.07, 24),
        reach.curve("position, fine", q(), 0.03, 52),
        reach.curve("position by direction", q(), 0.25, 8, forth),
        reach.curve("position by direction, narrow", q(), 0.07, 24, forth),
        reach.curve("position by speed", q(), 0.2, 8, speed),
        reach.curve("speed by direction", fast, 0.2, 8, forth),
        reach.curve("speed", fast, 0.2, 8),
        reach.curve("distance since it turned by direction", lambda x: x.turned, 0.2, 8, forth),
        reach.curve("load", load, 0.2, 8),
        reach.curve("load by direction", load, 0.2, 8, forth),
        reach.curve("load by speed", load, 0.25, 6, speed),
        reach.curve("load when driving", load, 0.25, 8, lambda x: x.direction * x.driving),
        reach.curve("load when braking", load, 0.25, 8, lambda x: x.direction * (1 - x.driving)),
        reach.curve("time by direction", lambda x: x.time, 0.25, 6, forth),
        reach.curve("time by speed", lambda x: x.time, 0.25, 6, speed),
        reach.curve("distance travelled by direction", lambda x: x.path, 0.25, 6, forth),
    ]
    others = sorted((o for o in range(len(names)) if o != joint), key=lambda o: abs(o - joint))[:NEIGHBOURS]
    for o in others if not alone else ():
        if not reach.moves(q(o)):
            continue
        own += [
            reach.curve(f"position of {names[o]}", q(o), 0.2, 10),
            reach.curve(f"position of {names[o]}, fine", q(o), 0.06, 28),
            reach.curve(f"speed of {names[o]}", lambda x, o=o: x.qd[:, o], 0.2, 8),
            reach.curve(f"speed of {names[o]} by direction", lambda x, o=o: x.qd[:, o], 0.2, 8, forth),
            reach.curve(f"speed of {names[o]} by speed", lambda x, o=o: x.qd[:, o], 0.2, 8, speed),
            reach.curve(f"position of {names[o]} by direction", q(o), 0.2, 10, forth),
            reach.curve(f"position of {names[o]} by speed", q(o), 0.2, 10, speed),
            reach.map(f"speed and speed of {names[o]} by direction", fast, lambda x, o=o: x.qd[:, o], forth),
            reach.map(f"position and position of {names[o]}", q(), q(o)),
            reach.map(f"position and position of {names[o]} by direction", q(), q(o), forth),
        ]
    return own


class _Ranges:
    """Curves over the ranges that coordinates have in the training recordings."""

    def __init__(self, training: Sequence[Coordinates]) -> None:
        self._training = training

    def _range(self, of: Callable[[Coordinates], Array]) -> tuple[float, float]:
        every = [of(x) for x in self._training]
        return min(float(x.min()) for x in every), max(float(x.max()) for x in every)

    def moves(self, of: Callable[[Coordinates], Array]) -> bool:
        """Does a coordinate change?"""
        low, high = self._range(of)
        return high - low > 1e-6

    def curve(
        self,
        words: str,
        over: Callable[[Coordinates], Array],
        length: float,
        order: int,
        times: Callable[[Coordinates], Array] | None = None,
    ) -> NuisanceCurve:
        """Over one coordinate, times a signal."""
        low, high = self._range(over)

        def columns(x: Coordinates) -> Array:
            own = basis(over(x), low, high, length, order)
            return own if times is None else own * times(x)[:, None]

        return NuisanceCurve(words, columns)

    def map(
        self,
        words: str,
        over: Callable[[Coordinates], Array],
        other: Callable[[Coordinates], Array],
        times: Callable[[Coordinates], Array] | None = None,
    ) -> NuisanceCurve:
        """Over two coordinates, times a signal."""
        one, two = self._range(over), self._range(other)

        def columns(x: Coordinates) -> Array:
            a, b = basis(over(x), *one, 0.3, 5), basis(other(x), *two, 0.3, 5)
            own = (a[:, :, None] * b[:, None, :]).reshape(len(a), -1)
            return own if times is None else own * times(x)[:, None]

        return NuisanceCurve(words, columns)
