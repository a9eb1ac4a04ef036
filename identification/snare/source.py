"""Captures behind the one interface: a simulation that answers to values, with slopes by differences.

The shifts are numbers of the set-up that are known to a tolerance (`TOLERANCES`), the same in all recordings, then each
recording's own start velocity, which is fitted to its first half second.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.effect import Effect, Parameter
from ...models.effects import get_effect
from ...models.model import Model, PlacedEffect, places
from ...models.snare.setup import APPLIED, NUMBERS, TOLERANCES, CaptureSetup, SnareTree
from ..deciding import BLOCK
from ..nuisance.curve import basis
from ..nuisance.noise import NoiseChannel
from ..sources.source import GridPoint, Linearisation, ModelPoint
from .noise import noise_channels
from .recording import CaptureRecording, Track, check_sensors, load_captures, sensed_by
from .runs import CaptureRuns
from .seen import QUARTER, channels, motion, seen, unit_of

Array = NDArray[np.float64]

WIDE = 0.25
"""Step of a difference, as a share of a parameter's own size: so wide that what it changes stands out of the cables'
chatter."""
LENGTH, ORDER = 0.2, 8
"""Of nameless curves: length scale, as a share of the range, and sines."""
FEWEST_BLOCKS = 4


class Captures:
    """Captures of a model, the training recordings first, while their processes run."""

    anew, bent, steps = False, True, 8

    def __init__(self, model: Model, records: Sequence[CaptureRecording], n_train: int, runs: CaptureRuns) -> None:
        """Simulate nothing yet."""
        self.setup = model.tree_as(SnareTree).setup
        self.model, self.records, self.runs = model, tuple(records), runs
        self.train, self.held = range(n_train), range(n_train, len(records))
        self.n_shifts = shifts_of(len(records))
        self.channels = channels(self.records[0])
        self._measured = [seen(r, r.measured) for r in self.records]

    def measured(self, i: int) -> Array:
        return self._measured[i]

    def tracks(self, i: int, many: Sequence[ModelPoint]) -> list[Track | None]:
        """Simulations of a recording at many points, side by side."""
        return self.runs([(i, self._values(at), tuple(map(float, at.shifts[self._own(i)]))) for at in many])

    @staticmethod
    def _own(i: int) -> slice:
        """A recording's start velocity among the shifts."""
        return slice(shifts_of(i), shifts_of(i + 1))

    def _values(self, at: ModelPoint) -> dict[str, float]:
        """Effects' values, and numbers within their tolerances where no effect has them; none is negative."""
        moved = {k: x for k, x in self._shifted(at).items() if x}
        return {k: max(self.setup.usual(k.partition(".")[0]) + x, 0.0) for k, x in moved.items()} | at.all_values

    @staticmethod
    def _shifted(at: ModelPoint) -> dict[str, float]:
        """How far numbers are from what they are said to be."""
        return {k: float(x * s) for (k, x), s in zip(TOLERANCES.items(), at.shifts, strict=False)}

    def _seen(self, i: int, many: Sequence[ModelPoint]) -> list[Array | None]:
        found = [None if t is None else seen(self.records[i], t) for t in self.tracks(i, many)]
        return [x if x is not None and np.all(np.isfinite(x)) else None for x in found]

    def predicted(self, i: int, at: ModelPoint) -> Array | None:
        return self._seen(i, [at])[0]

    def refused(self, i: int) -> InputError:
        return InputError(
            f"{self.records[i].path}: the capture cannot be simulated from where the recording starts (the pin inside "
            "a cable, or steps that do not converge); check [capture] against the test's set-up"
        )

    def slopes(self, i: int, at: ModelPoint, here: Array) -> Array:
        pairs = zip(at.values, at.free, strict=True)
        sizes = [abs(v if self.inverse(p) else v - self.origin(p)) for v, (p, _) in pairs]
        usual = [self.size(p, x) for p, x in at.free]
        highs = [self.bounds(p, x)[1] for p, x in at.free]
        steps = WIDE * np.maximum(sizes, usual)
        return self._differences(i, at, here, np.diag(np.where(at.values + steps > highs, -steps, steps)), "values")

    def own_shifts(self, p: PlacedEffect) -> tuple[int, ...]:
        return tuple(k for k, name in enumerate(TOLERANCES) if name.startswith(f"{p.key}."))

    def shift_slopes(self, i: int, at: ModelPoint, here: Array) -> Array:
        own = self._own(i)
        felt = [*range(len(TOLERANCES)), *range(own.start, own.stop)]
        found = np.zeros((*here.shape, len(at.shifts)))
        found[:, :, felt] = self._differences(i, at, here, np.eye(len(at.shifts))[felt], "shifts")
        return found

    def _differences(self, i: int, at: ModelPoint, here: Array, steps: Array, of: str) -> Array:
        """Derivatives (n, c, k) over steps (k, K), along one number each, nothing where the capture cannot be
        simulated."""
        moved = [replace(at, **{of: getattr(at, of) + row}) for row in steps]
        ends = zip(self._seen(i, moved), steps.sum(axis=1), strict=True)
        own = [(here if x is None else x) / step - here / step for x, step in ends]
        return np.stack(own, axis=2) if own else np.zeros((*here.shape, 0))

    def settled(self, at: ModelPoint, numbers: Sequence[int]) -> ModelPoint:
        return at

    def scale(self) -> Array:
        """Of position, turn and force that of the axis with the most of it: little motion along one is no scale."""
        own = self.sizes(self.train)
        kinds = [name.rpartition(".")[0] for name in self.channels]
        return np.array([max(x for x, k in zip(own, kinds, strict=True) if k == kind) for kind in kinds])

    def sizes(self, numbers: Sequence[int]) -> Array:
        """RMS of each channel (c,) in some recordings: of positions, of the motion since the start."""
        every = np.concatenate([motion(self.records[i]) for i in numbers])
        return np.maximum(np.sqrt(np.nanmean(every**2, axis=0)), 1e-12)

    def bounds(self, p: PlacedEffect, x: Parameter) -> tuple[float, float]:
        return x.low, x.high

    def origin(self, p: PlacedEffect) -> float:
        """Value of an effect's parameter that stands for its absence."""
        return self.setup.usual(p.effect.name)

    @staticmethod
    def inverse(p: PlacedEffect) -> bool:
        """Does an effect do the less, the larger its parameter is?"""
        return (APPLIED | NUMBERS)[p.effect.name].inverse

    def size(self, p: PlacedEffect, x: Parameter) -> float:
        if self.inverse(p):
            return min(x.grid)
        return min(abs(g - self.origin(p)) for g in x.grid)

    def unit(self, p: PlacedEffect, x: Parameter) -> str:
        return x.unit

    def library(self, placed: Sequence[PlacedEffect]) -> list[PlacedEffect]:
        """Effects of the vocabulary, and numbers of the set-up that the model file does not give: to correct one is no
        missing physics."""
        have = {p.key for p in placed}
        every = [PlacedEffect(get_effect(n), at) for n in APPLIED for at in places(get_effect(n), self.model.tree)]
        # Of a target that turns, mass and inertia go together.
        known = {*self.setup.given, *(("mass",) if self.setup.target.rotates else ())}
        every += [PlacedEffect(number(name, self.setup), a.at) for name, a in NUMBERS.items() if name not in known]
        return [p for p in every if p.key not in have]

    def variants(self, p: PlacedEffect) -> list[GridPoint]:
        """A parameter is an amplitude, counted from what the set-up has; an inverse one is a shape of a whole law."""
        (x,) = p.effect.parameters
        key = f"{p.key}.{x.name}"
        if self.inverse(p):
            return [GridPoint(p, {key: g}, (), inverse=True) for g in x.grid]
        return [GridPoint(p, {key: g}, (key,), origin={key: self.origin(p)}) for g in x.grid]

    def columns(self, i: int, at: ModelPoint, many: Sequence[GridPoint]) -> list[Array]:
        """What the simulation changes by, for a unit of an amplitude."""
        none, *each = self._seen(i, [at, *(self._with(at, v) for v in many)])
        assert none is not None
        found = []
        for v, own in zip(many, each, strict=True):
            change = np.full_like(none, np.nan) if own is None else own - none
            ((key, value),) = v.values.items()
            found.append((change / (value - v.origin[key]) if v.amplitudes else change)[:, :, None])
        return found

    def _with(self, at: ModelPoint, v: GridPoint) -> ModelPoint:
        """With an effect at a point of its grid; on top of a number's shift, where it stands for that number."""
        moved = self._shifted(at)
        return at.with_effects([v.placed], {k: x + moved.get(k, 0.0) for k, x in v.values.items()})

    def curves(self, numbers: Sequence[int]) -> Mapping[tuple[int, str], list[Array]]:
        """Over time, since the ring closes by the clock, and over the target's place along the channel's axis, as the
        model as given has it: a measured one would explain its own noise."""
        found: dict[tuple[int, str], list[Array]] = {}
        every, at = [*self.train, *self.held], start(self.model, len(self.records))
        seen_first = {i: self._seen(i, [at])[0] for i in every}
        places = {i: np.zeros((len(self._measured[i]), 3)) if x is None else x[:, :3] for i, x in seen_first.items()}
        last = max(len(x) for x in self._measured)
        for c, name in enumerate(self.channels):
            clock = [np.arange(len(self._measured[i]), dtype=float) for i in numbers]
            found[c, "time"] = [basis(t, 0.0, last, LENGTH, ORDER) for t in clock]
            if unit_of(name) not in ("m", "N"):
                continue
            own = {i: places[i][:, "xyz".index(name[-1])] for i in every}
            low, high = min(x.min() for x in own.values()), max(x.max() for x in own.values())
            if high > low:
                found[c, "position"] = [basis(own[i], low, high, LENGTH, ORDER) for i in numbers]
        return found

    def noise_channels(
        self, numbers: Sequence[int], linear: Linearisation, could: Sequence[Sequence[Array]]
    ) -> list[list[NoiseChannel]]:
        (tracks,) = zip(*(self.tracks(i, [linear.at]) for i in numbers), strict=True)
        return noise_channels(self.channels, tracks, linear, could, self.scale())

    def blocks(self, i: int, x: Array) -> Array:
        return np.array([b.sum() for b in np.array_split(x, max(int(len(x) * QUARTER / BLOCK), FEWEST_BLOCKS))])


def shifts_of(recordings: int) -> int:
    """How many numbers so many recordings have that may be off."""
    return len(TOLERANCES) + 3 * recordings


def start(model: Model, recordings: int) -> ModelPoint:
    """The model of so many recordings as given; a parameter without a value starts at what hardware usually has."""
    setup, values = model.tree_as(SnareTree).setup, {}
    for p in model.effects:
        (x,) = p.effect.parameters
        usual = setup.usual(p.effect.name) if APPLIED[p.effect.name].absent is None else x.grid[0]
        values[f"{p.key}.{x.name}"] = model.values.get(f"{p.key}.{x.name}", usual)
    return ModelPoint.of(model.effects, values, shifts_of(recordings))


def number(name: str, setup: CaptureSetup) -> Effect:
    """A number of the set-up as what may be another than the model has."""
    said, words = setup.usual(name), name.replace("_", " ")
    grid = tuple(share * said for share in NUMBERS[name].grid)
    value = Parameter("value", "kg" if name == "mass" else "m", words, low=0.5 * said, high=2 * said, grid=grid)

    def law(_s: Mapping[str, ca.SX], p: Mapping[str, ca.SX]) -> ca.SX:
        return p["value"]

    meaning = f"the set-up's {words} is not the model's"
    return Effect(name, "set-up", "target", meaning, name, "", (value,), law, experiment="measure it")


@contextmanager
def captures_of(
    model: Model, recordings: Sequence[str | Path], holdout: Sequence[str | Path], jobs: int | None
) -> Iterator[Captures]:
    """Captures, those to be fitted first, for as long as their processes run.

    Each has its force sensor where its sign says, in a simulation of the model as it comes.
    """
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs}; allowed is a whole number from 1")
    if not recordings:
        raise InputError("recordings: none is given; give one or more")
    records, n = load_captures(model, [*recordings, *holdout]), len(recordings)
    check_sensors(records)
    with CaptureRuns(records, jobs or min(4, os.cpu_count() or 1)) as runs:
        values = start(model, 0).all_values
        tracks = runs([(i, values, (0.0, 0.0, 0.0)) for i in range(len(records))])
        records = [sensed_by(r, track) for r, track in zip(records, tracks, strict=True)]
        check_sensors(records)
        source = Captures(model, records, n, runs)
        for i, track in enumerate(tracks):
            if track is None:
                raise source.refused(i)
        yield source
