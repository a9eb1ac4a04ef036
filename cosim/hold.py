"""A participant's input during a macro step: a polynomial through the newest values at communication points.

The values are known up to the start of the step (extrapolation), or at its end too (interpolation: an earlier
participant of a sequential sweep has been there already, or an iteration assumes where it will be). One rule gives
every hold: the polynomial of the hold's degree through the newest points that are known.

============  ======  =====================================================================================
hold          degree  given to the participant
============  ======  =====================================================================================
constant      0       the newest value
midpoint      1       the line's value at the middle of the step, held
linear        1       the line; where a participant takes no slope, its mean over the step, held
quadratic     2       the parabola; what a participant does not take of it is replaced by its mean, held, or by two
                      values, each held over half the step
============  ======  =====================================================================================

A held mean gives the participant the right impulse. What remains is the shape inside the step, an error of H³ in a
position, so that every hold but the constant one is of order 2 or more (Busch 2016, Continuous approximation
techniques for co-simulation methods: analysis of numerical stability and local error, ZAMM 96). Two values have the
parabola p's mean m and its first moment too, which two integrations in a row see,

    m ∓ p'(H/2)·H/3    over the first and the second half,

and leave an error of H⁴ where inputs enter linearly: order 3 without slopes.
"""

import functools
from dataclasses import dataclass

import numpy as np

from ..errors import InputError


@dataclass(frozen=True)
class Hold:
    """One way to hold an input.

    Parameters
    ----------
    degree : int
        Of the polynomial; one more point than this is wanted.
    middle : bool
        Give the value at the middle of the step, never a slope.
    """

    degree: int
    middle: bool = False


HOLDS = {"constant": Hold(0), "linear": Hold(1), "quadratic": Hold(2), "midpoint": Hold(1, middle=True)}
"""Every hold by its name."""


HALVES = -1
"""In place of a number of derivatives: the participant takes two values, each held over half the step."""


def hold_named(name: str) -> Hold:
    """The hold of that name; InputError with all names where there is none."""
    if name not in HOLDS:
        raise InputError(f"hold {name!r} is unknown; choose {', '.join(HOLDS)}")
    return HOLDS[name]


@functools.lru_cache(maxsize=1024)  # equal steps ask for the same weights again and again
def weights(hold: Hold, nodes: tuple[float, ...], size: float, order: int) -> tuple[tuple[float, ...], ...]:
    """Weights of the known values in a participant's input.

    Parameters
    ----------
    hold : Hold
    nodes : tuple of float
        Times of the known values, newest first, in steps from the start of this one: 1 is its end, 0 its start.
        As many as there are, up to ``degree + 1``.
    size : float
        Macro step [s].
    order : int
        Derivatives that the participant takes, or `HALVES`.

    Returns
    -------
    tuple of 1 to 3 rows, one weight a node
        For the value, then for the first and second derivative at the start of the step; or for both halves' values.
    """
    powers = np.arange(len(nodes))
    coefficients = np.linalg.inv(np.power.outer(np.array(nodes), powers))  # (power, node)
    if hold.middle:
        return (tuple(map(float, 0.5**powers @ coefficients)),)
    if order == HALVES:
        mean, slope = (1.0 / (powers + 1)) @ coefficients, powers * 0.5 ** (powers - 1.0) @ coefficients
        return tuple(tuple(map(float, mean + sign * slope / 3)) for sign in (-1, 1))
    taken = powers <= order
    value = coefficients[0] + (1.0 / (powers + 1))[~taken] @ coefficients[~taken]
    derivatives = [coefficients[p] * (1, 1, 2)[p] / size**p for p in powers[1:] if taken[p]]
    return tuple(tuple(map(float, row)) for row in (value, *derivatives))


@functools.lru_cache(maxsize=1024)
def end_weights(nodes: tuple[float, ...]) -> tuple[float, ...]:
    """Weights of the known values in the polynomial's value at the end of the step."""
    powers = np.arange(len(nodes))
    return tuple(map(float, np.ones(len(nodes)) @ np.linalg.inv(np.power.outer(np.array(nodes), powers))))


def combine(factors: tuple[float, ...], values: list[np.ndarray]) -> np.ndarray:
    """Weighted sum of as many arrays, newest first."""
    total = factors[0] * values[0]
    for factor, value in zip(factors[1:], values[1:], strict=False):
        total += factor * value
    return total
