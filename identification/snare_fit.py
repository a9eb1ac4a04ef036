"""Effects of a capture fitted with the simulation in the loop.

What is compared comes in blocks: position and force averaged over a quarter of a second, and the logarithm of the
force's chatter over half a second (RMS of its 50 ms means about those averages). A block's scale is not known
beforehand: engines, meshes and contact laws differ by more than sensors do. With the scales left free the
log-likelihood is, up to a constant (Beck and Arnold 1977),

    L = −½ Σ_b n_b ln(RSS_b/n_b + f_b²),

f_b the least that sensors scatter and engines differ by. n_b counts what is news: neighbours in time miss alike. Steps
are Gauss and Newton's on L, with derivatives by differences over steps so wide that chatter does not rule them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import log10

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..models.model import Placed
from ..models.snare.setup import APPLIED, NUMBERS
from .least_squares import Normal, bounded_step
from .snare_recording import EVERY, Capture, Track
from .snare_runs import Runs, tracks_at, usable

Array = NDArray[np.float64]

SLOW, LONG = 5, 10
"""Times of a track in a slow mean (0.25 s), and in a number for the chatter (0.5 s)."""
NEWS = 0.25
"""Share of the numbers that counts."""
LEAST = {"position": 4e-4, "turn": 4e-3, "slow": 0.05, "chatter": 0.15}
"""What engines that are both right differ by: position [m], orientation [rad], force [N], ln(chatter). MuJoCo's rods
and this snare do by 0.3 to 0.5 mm. Less than that is no physics left out."""
LEAST_SHARE = 0.1
"""The same of a force, as a share of its RMS; the rods and this snare: 0.10 to 0.13."""
QUIET = 0.05
"""[N] Chatter below this is none."""
STRIDE = 8.0
"""Most that a parameter moves in one step, in units of its difference."""
SETTLED = 0.3
"""A step that gains less of the log-likelihood ends a fit."""


@dataclass(frozen=True)
class Handle:
    """A parameter as the fit turns it: ``value = 10^x``, ``x²`` or ``x``; bounds and difference in x; values to try."""

    scale: str
    low: float
    high: float
    step: float
    tries: tuple[float, ...]

    def x(self, value: float) -> float:
        """Where the handle stands at a value."""
        if self.scale == "log":
            return log10(max(value, 10**self.low))
        return max(value, 0.0) ** 0.5 if self.scale == "root" else value

    def value(self, x: float) -> float:
        """The value there."""
        return 10**x if self.scale == "log" else x * x if self.scale == "root" else x


HANDLES = {
    "contact_friction": Handle("plain", 0.0, 1.5, 0.03, (0.08, 0.25)),
    "contact_damping": Handle("log", 0.0, 5.0, 0.3, (200.0, 2e3)),
    "contact_stiffness": Handle("log", 5.0, 10.0, 0.25, (1e7, 1e6)),
    "cable_damping": Handle("log", -4.5, -0.5, 0.2, (2e-4, 1e-2)),
    "cable_pretension": Handle("plain", 0.0, 5000.0, 60.0, (200.0, 800.0)),
    "umbilical_stiffness": Handle("root", 0.0, 100.0, 1.0, (20.0, 100.0, 500.0)),
    "hang_point_clearance": Handle("plain", 0.0, 0.1, 4e-4, (2e-3, 8e-3)),
    "ring_radius": Handle("plain", 0.08, 0.25, 3e-4, (0.1245, 0.130)),
    "pin_radius": Handle("plain", 3e-3, 0.02, 2e-4, (6e-3, 9.5e-3)),
    "mass": Handle("log", 0.0, 4.0, 0.04, (15.0, 40.0)),
}


Slopes = tuple[tuple[Mapping[str, Array], ...], ...]


@dataclass(frozen=True)
class Fit:
    """Effects with values, the log-likelihood L there, tracks and residuals of each capture, and its derivatives.

    ``residuals`` holds each capture's blocks by name, ``slopes`` the derivative of each by the handles, in their order;
    None where they were not asked for.
    """

    placed: tuple[Placed, ...]
    x: Array
    likelihood: float
    tracks: tuple[Track, ...]
    residuals: tuple[Mapping[str, Array], ...]
    slopes: Slopes | None = None

    @property
    def values(self) -> dict[str, float]:
        """Parameters by ``effect.place.parameter``."""
        return values_of(self.placed, self.x)


def values_of(placed: Sequence[Placed], x: Array) -> dict[str, float]:
    """Parameters by ``effect.place.parameter`` at the handles' places."""
    return {key_of(p): HANDLES[p.effect.name].value(float(v)) for p, v in zip(placed, x, strict=True)}


def key_of(placed: Placed) -> str:
    """``effect.place.parameter`` of an effect, which has one."""
    return f"{placed.key}.{(APPLIED | NUMBERS)[placed.effect.name].parameter}"


def blocks(capture: Capture, track: Track) -> dict[str, Array]:
    """What a track is compared by: (n, c) arrays by name, in m, rad, N and 1."""
    found = {"position": _thin(track.position)}
    if capture.setup.target.rotates:
        start = Rotation.from_quat(capture.setup.target.orientation, scalar_first=True).inv()
        known = np.isfinite(track.quaternion).all(1)
        turn = np.full((len(track.quaternion), 3), np.nan)
        turn[known] = (Rotation.from_quat(track.quaternion[known], scalar_first=True) * start).as_rotvec()
        found["turn"] = _thin(turn)
    for body in capture.sensors:
        force = track.force[body]
        slow = _thin(force)
        fast = np.sum((force[: SLOW * len(slow)] - np.repeat(slow, SLOW, axis=0)) ** 2, axis=1)
        size = np.sqrt(fast[: len(fast) // LONG * LONG].reshape(-1, LONG).mean(1))
        found[f"slow.{body}"] = slow
        found[f"chatter.{body}"] = np.log(np.hypot(size, QUIET + capture.noise.get(body, 0.0)))[:, None]
    return found


def _thin(x: Array) -> Array:
    return x[: len(x) // SLOW * SLOW].reshape(-1, SLOW, x.shape[1]).mean(1)


def residual(capture: Capture, track: Track) -> dict[str, Array]:
    """Measurement less simulation, by block; 0 where nothing was measured."""
    ours, theirs = blocks(capture, track), blocks(capture, capture.measured)
    return {name: np.nan_to_num(theirs[name] - ours[name]) for name in theirs}


def floor(capture: Capture, name: str) -> float:
    """f_b: the least that a block's numbers count for."""
    kind, _, body = name.partition(".")
    sensor = {"position": capture.noise["position"], "slow": capture.noise.get(body, 0.0)}.get(kind, 0.0)
    carried = LEAST_SHARE * capture.carried[body] if kind == "slow" else 0.0
    return float(np.hypot(LEAST[kind] + carried, sensor / SLOW**0.5))


def likelihood(captures: Sequence[Capture], residuals: Sequence[Mapping[str, Array]]) -> float:
    """L of residuals; a block's scale is one for all captures."""
    return float(sum(-0.5 * NEWS * n * np.log(v) for n, v in scales(captures, residuals).values()))


def scales(captures: Sequence[Capture], residuals: Sequence[Mapping[str, Array]]) -> dict[str, tuple[int, float]]:
    """Numbers in a block of all captures together, and their variance with the floor."""
    found = {}
    for name in residuals[0]:
        every = [(r[name], floor(c, name)) for c, r in zip(captures, residuals, strict=True) if name in r]
        size = sum(x.size for x, _ in every)
        found[name] = (size, sum(float(np.sum(x**2)) + x.size * f * f for x, f in every) / size)
    return found


def evaluate(
    runs: Runs, captures: Sequence[Capture], numbers: Sequence[int], placed: Sequence[Placed], many: Sequence[Array]
) -> list[Fit]:
    """Simulate at many places of the handles; L is −inf where a capture cannot be."""
    found = []
    own = [captures[n] for n in numbers]
    for x, tracks in zip(many, tracks_at(runs, numbers, [values_of(placed, x) for x in many]), strict=True):
        if not usable(tracks):
            found.append(Fit(tuple(placed), x, -np.inf, (), ()))
            continue
        whole = tuple(t for t in tracks if t is not None)
        residuals = tuple(residual(c, t) for c, t in zip(own, whole, strict=True))
        found.append(Fit(tuple(placed), x, likelihood(own, residuals), whole, residuals))
    return found


def bounds(placed: Sequence[Placed]) -> tuple[Array, Array]:
    """Of the handles; one that is held stays where it starts, which the caller sees to."""
    pairs = [(HANDLES[p.effect.name].low, HANDLES[p.effect.name].high) for p in placed]
    return np.array([a for a, _ in pairs], float), np.array([b for _, b in pairs], float)


def with_slopes(runs: Runs, captures: Sequence[Capture], numbers: Sequence[int], at: Fit) -> Fit:
    """The same with derivatives by the handles, one difference each, away from the nearer bound."""
    if not len(at.x):
        return Fit(at.placed, at.x, at.likelihood, at.tracks, at.residuals, ())
    _, high = bounds(at.placed)
    steps = np.array([HANDLES[p.effect.name].step for p in at.placed])
    steps = np.where(at.x + steps > high, -steps, steps)
    many = [at.x + step * row for step, row in zip(steps, np.eye(len(steps)), strict=True)]
    slopes = []
    for there, step in zip(evaluate(runs, captures, numbers, at.placed, many), steps, strict=True):
        zero = tuple({name: np.zeros_like(r) for name, r in own.items()} for own in at.residuals)
        slopes.append(
            tuple(
                {name: (b[name] - a[name]) / step for name in a}
                for a, b in zip(at.residuals, there.residuals, strict=True)
            )
            if there.residuals
            else zero
        )
    return Fit(at.placed, at.x, at.likelihood, at.tracks, at.residuals, tuple(slopes))


def normal(captures: Sequence[Capture], at: Fit) -> tuple[Array, Array]:
    """Gradient (P,) and normal matrix (P, P) of −L by Gauss and Newton, scales as they are."""
    assert at.slopes is not None
    gradient, matrix = np.zeros(len(at.x)), np.zeros((len(at.x), len(at.x)))
    if not len(at.x):
        return gradient, matrix
    if not len(at.x):
        return gradient, matrix
    for name, (_, variance) in scales(captures, at.residuals).items():
        weight = NEWS / variance
        for c, own in enumerate(at.residuals):
            columns = np.stack([s[c][name].ravel() for s in at.slopes], axis=1)
            gradient += weight * columns.T @ own[name].ravel()
            matrix += weight * columns.T @ columns
    return gradient, matrix


def fit(
    runs: Runs,
    captures: Sequence[Capture],
    numbers: Sequence[int],
    start: Fit,
    most: int = 4,
) -> Fit:
    """Climb L from a start.

    Derivatives are taken once, where the start has none, and then follow the steps by Broyden's update (1965).

    Parameters
    ----------
    runs : Runs
    captures : sequence of Capture
        Of the runs, all of them.
    numbers : sequence of int
        Captures that are fitted.
    start : Fit
        Effects that hold their parameter are simulated with it and not moved.
    most : int
        Most steps.
    """
    own, placed = [captures[n] for n in numbers], start.placed
    free = np.array([not p.hold for p in placed], bool)
    if not np.isfinite(start.likelihood):
        return start
    here = start if start.slopes is not None else with_slopes(runs, captures, numbers, start)
    step = np.array([HANDLES[p.effect.name].step for p in placed])
    low, high = bounds(placed)
    low, high, stride = np.where(free, low, here.x), np.where(free, high, here.x), STRIDE * step
    for _ in range(most if free.any() else 0):
        gradient, matrix = normal(own, here)
        size = np.where(free, np.sqrt(np.diag(matrix)), 0.0)
        room = np.maximum(low - here.x, -stride), np.minimum(high - here.x, stride)
        move = bounded_step(Normal(0.0, gradient, matrix), size, 1e-2, *room)
        if np.all(np.abs(move) < 0.02 * step):
            break
        there = evaluate(runs, captures, numbers, placed, [here.x + share * move for share in (1.0, 0.4)])
        best = max(there, key=lambda f: f.likelihood)
        gained = best.likelihood - here.likelihood
        if gained > 0:
            here = replace(best, slopes=_broyden(here, best, step))
        elif there[1].residuals:
            here, stride = replace(here, slopes=_broyden(here, there[1], step)), 0.2 * stride
        if 0 <= gained < SETTLED:
            break
    return here


def started(runs: Runs, captures: Sequence[Capture], numbers: Sequence[int], placed: Sequence[Placed], x: Array) -> Fit:
    """A start for `fit`, inside the bounds but for what is held."""
    low, high = bounds(placed)
    free = np.array([not p.hold for p in placed], bool)
    return evaluate(runs, captures, numbers, placed, [np.where(free, np.clip(x, low, high), x)])[0]


def _broyden(here: Fit, there: Fit, step: Array) -> Slopes:
    """Derivatives that agree with a step that was taken: the least change, lengths in units of the differences."""
    assert here.slopes is not None
    move = there.x - here.x
    share = move / step**2 / max(float(np.sum((move / step) ** 2)), 1e-300)
    made: list[list[dict[str, Array]]] = [[] for _ in move]
    for c, (a, b) in enumerate(zip(here.residuals, there.residuals, strict=True)):
        foretold = {name: sum(own[c][name] * m for own, m in zip(here.slopes, move, strict=True)) for name in a}
        miss = {name: b[name] - a[name] - foretold[name] for name in a}
        for k, own in enumerate(here.slopes):
            made[k].append({name: own[c][name] + miss[name] * share[k] for name in a})
    return tuple(tuple(m) for m in made)


def spread(captures: Sequence[Capture], at: Fit) -> Array:
    """Standard deviation of each parameter's value (P,); inf where the recordings say nothing."""
    _, matrix = normal(captures, at)
    size = np.sqrt(np.diag(matrix))
    known = size > 0
    result = np.full(len(size), np.inf)
    if known.any():
        unit = matrix[np.ix_(known, known)] / np.outer(size[known], size[known])
        result[known] = np.sqrt(np.maximum(np.diag(np.linalg.pinv(unit, rcond=1e-10)), 0)) / size[known]
    factor = []
    for p, x in zip(at.placed, at.x, strict=True):
        h = HANDLES[p.effect.name]
        factor.append(abs(h.value(float(x) + h.step) - h.value(float(x))) / h.step)
    return result * np.array(factor, float)


def seconds(capture: Capture) -> float:
    """Length of a capture [s]."""
    return EVERY * (len(capture.times) - 1)
