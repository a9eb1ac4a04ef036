"""Recordings of a servo as a source: its position, simulated in closed loop, with derivatives by finite differences.

No set-up's number has a stated tolerance, so there are no shifts: the motor's numbers are parameters like a law's.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.effect import Effect, Parameter, written_unit
from ...models.effects import get_effect
from ...models.model import PlacedEffect
from ...models.servo_loop import DRIVE, GRAVITY, LEAST, ROTOR, ServoRun, laws, simulate
from ..arms.blocks import FEWEST_BLOCKS
from ..deciding import BLOCK, LEAST_LEVEL, SETTLES, STICKS
from ..evidence.prior import parts_of
from ..fitting.experiment import Scales
from ..nuisance.noise import NoiseChannel
from ..sources.fit import changes, differences
from ..sources.source import GridPoint, Linearisation, ModelPoint

Array = NDArray[np.float64]

EVERY = 0.05
"""[s] Windows over which positions are averaged."""
WIDE = 0.03
"""A usual size of a parameter changes the torque by so much [share of the load's RMS]: a law's column, the change
of the simulation for so much of it, sees past single instants of sticking."""


class Servos:
    """Recordings of a servo, the training recordings first; ``joint`` is what its place is called."""

    n_shifts, anew, bent, steps = 0, False, False, 8

    def __init__(self, joint: str, train: Sequence[ServoRun], held: Sequence[ServoRun] = ()) -> None:
        """Simulate nothing yet."""
        if not train:
            raise InputError("recordings: none is given; give one or more")
        self.joint, self.runs = joint, (*train, *held)
        self.train, self.held = range(len(train)), range(len(train), len(self.runs))
        self.channels = (f"q.{self.joint}",)
        self._measured = [_means(r, r.position)[:, None] for r in self.runs]
        self._known: dict[tuple[int, tuple[tuple[str, float], ...]], Array | None] = {}
        self._sizes: dict[tuple[str, str], float] = {}
        own = [self.runs[i] for i in self.train]
        self._q, self._qd = (np.concatenate(x) for x in ([r.position for r in own], [_speed(r) for r in own]))
        self._load = np.concatenate([r.mass * GRAVITY * r.length * np.sin(r.position) for r in own])
        self._volts = np.concatenate([np.clip(r.gain * (r.goal - r.position), -1, 1) * r.volts * r.on for r in own])
        moves = [np.abs(np.diff(r.position)) for r in own]
        self._step = min((float(x[x > 0].min()) for x in moves if np.any(x > 0)), default=0.0)
        travel = max(float(np.ptp(r.position)) for r in own)
        sizes = float(np.abs(self._qd).max()), travel, float(np.abs(self._load).max())
        speed, travel, load = (max(x, LEAST) for x in sizes)
        self._scales = Scales(speed, travel, load, 0.5 * float(self._q.min() + self._q.max()))
        self._laws = [e for e in laws() if not self._alias(e)]

    def measured(self, i: int) -> Array:
        return self._measured[i]

    def predicted(self, i: int, at: ModelPoint) -> Array | None:
        return self._seen(i, at.all_values)

    def _seen(self, i: int, values: Mapping[str, float]) -> Array | None:
        """Positions of a simulation (n, 1), each worked out once."""
        key = i, tuple(sorted(values.items()))
        if key not in self._known:
            q = simulate(self.runs[i], plain(values))
            self._known[key] = _means(self.runs[i], q)[:, None] if np.all(np.isfinite(q)) else None
        return self._known[key]

    def refused(self, i: int) -> InputError:
        return InputError(f"{self.runs[i].name}: the servo cannot be simulated; check its gain, mass and length")

    def slopes(self, i: int, at: ModelPoint, here: Array) -> Array:
        return differences(self, i, at, here)

    def own_shifts(self, p: PlacedEffect) -> tuple[int, ...]:
        return ()

    def shift_slopes(self, i: int, at: ModelPoint, here: Array) -> Array:
        return np.zeros((*here.shape, 0))

    def settled(self, at: ModelPoint, numbers: Sequence[int]) -> ModelPoint:
        return at

    def scale(self) -> Array:
        """RMS about the mean: where zero is says nothing of the motion."""
        return np.maximum(np.std(np.concatenate([self._measured[i] for i in self.train]), axis=0), LEAST)

    def bounds(self, p: PlacedEffect, x: Parameter) -> tuple[float, float]:
        scale, origin = self._scales.of(x.relative_to), self._scales.origin(x.relative_to)
        return origin + x.low * scale, origin + x.high * scale

    def size(self, p: PlacedEffect, x: Parameter) -> float:
        """As much as changes the torque by `WIDE`, along the recorded motion."""
        if x.grid:
            return min(abs(g) for g in x.grid) * self._scales.of(x.relative_to)
        key = p.effect.name, x.name
        if key not in self._sizes:
            self._sizes[key] = WIDE * _rms(self._load) / max(self._torque(p.effect, x), LEAST)
        return self._sizes[key]

    def _torque(self, effect: Effect, x: Parameter) -> float:
        """RMS torque for a unit of a parameter."""
        r = self.runs[0]
        if effect == ROTOR:
            return _rms(self._load) / (r.mass * r.length**2)
        if x.name == "zero":
            return r.mass * GRAVITY * r.length
        if effect == DRIVE:
            volts = max(_rms(self._volts), LEAST)
            return volts if x.name == "torque_per_volt" else _rms(self._load) / volts * _rms(self._qd)
        return _rms(self._along(effect)[x.name])

    def _along(self, effect: Effect) -> dict[str, Array]:
        """Torque for a unit of each amplitude of a law, along the recorded motion."""
        moving = np.where(self._qd < 0, -1, 1) * np.maximum(np.abs(self._qd), LEAST)
        rows = {"q": self._q, "qd": moving, "load": self._load, "speed_scale": np.full_like(self._q, LEAST)}
        # A law of symbols is one of numbers too.
        signals: Any = {k: ca.DM(v) for k, v in rows.items()}
        shapes = {x.name: self._placed(x, x.zero) for x in effect.parameters if x.grid}
        names = [x.name for x in effect.parameters if not x.grid]
        units: list[Any] = [shapes | {other: float(other == name) for other in names} for name in names]
        return {k: np.array(effect.law(signals, x)).ravel() for k, x in zip(names, units, strict=True)}

    def _placed(self, x: Parameter, share: float) -> float:
        """A number of a parameter's grid in SI units."""
        return self._scales.origin(x.relative_to) + share * self._scales.of(x.relative_to)

    def _alias(self, effect: Effect) -> bool:
        """Is a law, with another torque per volt, its own special case? No recording has a torque: a share of the load
        may as well be the motor's."""
        parts = [get_effect(name) for name in effect.contains]
        if not parts:
            return False
        own, known = [np.stack([self._load, *(x for e in some for x in self._along(e).values())])
                      for some in ([*parts, effect], parts)]  # fmt: skip
        return bool(np.linalg.matrix_rank(own, 1e-6 * np.linalg.norm(own)) ==
                    np.linalg.matrix_rank(known, 1e-6 * np.linalg.norm(known)))  # fmt: skip

    def unit(self, p: PlacedEffect, x: Parameter) -> str:
        return written_unit(x.unit)

    def library(self, placed: Sequence[PlacedEffect]) -> list[PlacedEffect]:
        """A whole law is another way to write the sum of its parts, and no candidate beside one."""
        have = {p.key for p in placed}
        every = [PlacedEffect(e, self.joint) for e in self._laws]
        return [p for p in every if p.key not in have and not have & parts_of(p)]

    def variants(self, p: PlacedEffect) -> list[GridPoint]:
        """A parameter without a grid is an amplitude."""
        shapes = [x for x in p.effect.parameters if x.grid]
        amplitudes = tuple(f"{p.key}.{x.name}" for x in p.effect.parameters if not x.grid)
        axes = [[self._placed(x, g) for g in x.grid] for x in shapes]
        return [
            GridPoint(p, {f"{p.key}.{x.name}": v for x, v in zip(shapes, point, strict=True)}, amplitudes)
            for point in product(*axes)
        ]

    def columns(self, i: int, at: ModelPoint, many: Sequence[GridPoint]) -> list[Array]:
        return [self._column(i, at, v) for v in many]

    def _column(self, i: int, at: ModelPoint, v: GridPoint) -> Array:
        """Change of the simulation for each amplitude, from zero."""
        none = self.predicted(i, at)
        assert none is not None
        steps = {f"{v.placed.key}.{x.name}": self.size(v.placed, x) for x in v.placed.effect.parameters if not x.grid}
        base = {**at.all_values, **v.values, **dict.fromkeys(steps, 0.0)}
        return changes(none, ((self._seen(i, {**base, k: x}), x) for k, x in steps.items()))

    def curves(self, numbers: Sequence[int]) -> Mapping[tuple[int, str], list[Array]]:
        return {}

    def noise_channels(
        self, numbers: Sequence[int], linear: Linearisation, could: Sequence[Sequence[Array]]
    ) -> list[list[NoiseChannel]]:
        """Where the servo stands, friction holds it anywhere about its goal: what nothing explains there, in the RMS,
        and `LEAST_LEVEL` of the channel at least. Everywhere the encoder's steps hold their error."""
        speeds = [np.abs(np.gradient(self._measured[i][:, 0], EVERY)) / self._scales.speed for i in numbers]
        rest = [x < STICKS[0][0] for x in speeds]
        left = np.concatenate([r[k, 0] for r, k in zip(linear.residuals, rest, strict=True)])
        beside = np.concatenate([x[k] for x, k in zip(could[0], rest, strict=True)])
        level = LEAST_LEVEL * float(self.scale()[0])
        if len(left) > 2 * beside.shape[1]:
            left = left - beside @ np.linalg.lstsq(beside, left, rcond=1e-6)[0]
            level = max(level, float(np.sqrt(left @ left / (len(left) - beside.shape[1]))))
        step = min(self._step / np.sqrt(12) / level, 1.0)
        return [
            [NoiseChannel(EVERY, (slice(0, len(x)),), np.zeros(len(x)),
                          tuple(np.where(x < width, 1.0, step) for width, _ in STICKS),
                          (x < SETTLES[0]).astype(float), level)]
            for x in speeds
        ]  # fmt: skip

    def blocks(self, i: int, x: Array) -> Array:
        return np.array([b.sum() for b in np.array_split(x, max(int(len(x) * EVERY / BLOCK), FEWEST_BLOCKS))])


def plain(values: Mapping[str, float]) -> dict[str, float]:
    """Values by ``effect.parameter``, as a simulation takes them, from those by ``effect.place.parameter``."""
    return {f"{effect}.{name}": x for key, x in values.items() for effect, _, name in [key.split(".")]}


def _means(run: ServoRun, x: Array) -> Array:
    """Mean over each whole window (n,)."""
    number = ((run.time - run.time[0]) / EVERY).astype(int)
    n = number[-1]
    return np.bincount(number, x)[:n] / np.bincount(number)[:n]


def _speed(run: ServoRun) -> Array:
    """Speed at the samples, of the windows' means [rad/s]."""
    q = _means(run, run.position)
    return np.interp(run.time - run.time[0], EVERY * (np.arange(len(q)) + 0.5), np.gradient(q, EVERY))


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))


def start(joint: str, placed: Sequence[PlacedEffect], values: Mapping[str, float]) -> ModelPoint:
    """A model's effects with its drive and rotor, at values by ``effect.parameter`` to start a fit from."""
    have = {p.effect.name for p in placed}
    every = [*(PlacedEffect(e, joint) for e in (DRIVE, ROTOR) if e.name not in have), *placed]
    return ModelPoint.of(every, {f"{p.key}.{x.name}": values[f"{p.effect.name}.{x.name}"]
                                 for p in every for x in p.effect.parameters}, 0)  # fmt: skip
