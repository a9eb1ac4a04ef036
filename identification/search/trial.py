"""One effect at one place, tried on every ground that suits it: its best shape, and what the recordings say of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.effect import Effect
from .candidates import Variant, free_parameters, reduced
from .encoder_noise import UNEVEN
from .grounds import NULLS, Grounds, Reading, Readings
from .judged import Case, Judged, Parts, Samples

Array = NDArray[np.float64]
Option = tuple[Variant, dict[int, Parts]]
"""A point of the grid over an effect's shapes, and its columns."""

MATERIAL = 0.015
"""Share of a channel's RMS torque below which a change of a law's shape, or something without a name, is not told."""

IDEALISED = 0.05
"""Share of what slings and booms do to a channel that their laws may have wrong: a carriage that follows is no lag of
first order, a boom no spring without mass. What explains no more than that is not told from it."""

WORTH = 0.05
"""Least share of its channels' residual energy that an effect must explain to be named."""

WIDER = 0.025
"""The same of what says more of a link whose mass or centre is named already, and takes its place."""

MOST = 0.75
"""Share of its channel's residual energy beyond what is left in motion from which on an effect with a memory of where
the joint turned is named for what it does near rest: joints that stick and rounded signs look like one, and leave most
of it. A joint that stands quite still while it sticks lets go after no travel at all: that is not one, either."""

DRIVEN_MOST = 0.25
"""Share of its own channel's residual energy from which on a drive's spring or play is named for what it explains along
the motion as measured, which knows how the link rings: what disturbances drive looks like one too, and leaves most."""

TUNINGS = 3
"""Rounds in which the shape of such a candidate is tuned; what rings falls between the points of a grid."""


@dataclass
class Null:
    """Best score that any candidate reaches on each set of channels with sign-flipped noises, so far (NULLS,)."""

    scores: dict[tuple[int, ...], Array]

    def enter(self, reached: tuple[int, ...], scores: Array) -> None:
        """Note a candidate's."""
        self.scores[reached] = np.maximum(self.scores.get(reached, np.zeros(NULLS)), scores)


@dataclass(frozen=True)
class Trial:
    """The better of what the grounds make of an effect, and what the motion that was asked for makes of it, where that
    is another: of a drive that was judged along the motion as measured."""

    best: Judged
    asked: Judged | None


def tried(ground: Grounds, options: Sequence[Option], null: Null) -> Trial | None:
    """Judge an effect at a place; None where the baseline can mimic it.

    Parameters
    ----------
    ground : Grounds
    options : sequence of Option
        Columns from the reading that `source` names.
    null : Null
        What noise alone reaches is entered.
    """
    judge = _Judge(ground)
    effect, whole = options[0][0].placed.effect, ground.readings.everywhere
    plain = judge(ground.measured if effect.at_rest else ground.asked, options, null)
    asked: Judged | None = None
    others: list[Judged | None] = []
    if effect.acts_on == "position":
        if plain is not None and judge.beyond_noise(plain, ground.asked, ground.readings.asked) < WORTH:
            plain = None
        driven = judge.along_measured([v for v, _ in options])
        if driven is not None:
            asked, others = plain, [driven]
    if effect.exceeds_at_rest or effect.remembers:
        near = [(v, whole.columns(v)) for v, _ in options]
        if effect.exceeds_at_rest:
            others.append(judge(ground.near_rest, near))
        if effect.remembers:
            j = judge(ground.near_rest.alone(), near)
            if j is not None and j.explained > MOST * ground.excess(j.channels[0]) and not _sticks(j, options):
                others.append(j)
    if effect.at_rest and plain is not None and plain.case.share() > WORTH:
        # What is plain in motion may be worth its name for what it does near rest.
        share = ground.near_rest.alone().explained(plain.variant, whole.columns(plain.variant))
        plain = replace(plain, explained=max(plain.explained, share))
    best = max((j for j in (plain, *others) if j is not None), key=lambda j: j.score, default=None)
    if best is None:
        return None
    free = judge.free(best.variant)
    hold = tuple(p.name for p in best.placed.effect.parameters if p.name not in free)
    return Trial(replace(best, placed=replace(best.placed, hold=hold)), asked)


def _sticks(j: Judged, options: Sequence[Option]) -> bool:
    """Does a joint let go after no travel that could be told from none, the shortest of the grid being the best?"""
    return bool(np.all(j.variant.parameters == np.min([v.parameters for v, _ in options], axis=0)))


def source(along: Readings, effect: Effect) -> Reading:
    """The reading that an effect's columns come from: the smallest motion shows friction that sticks, and a low-passed
    one has lost it."""
    return along.measured if effect.at_rest else along.asked


class _Judge:
    """Candidates before samples, at the price of their parameters."""

    def __init__(self, ground: Grounds) -> None:
        self._ground = ground
        self._log_size = np.log(ground.asked.evidence.size)
        self._prices: dict[bytes, float] = {}

    def free(self, variant: Variant) -> tuple[str, ...]:
        """Names of the parameters that a variant has."""
        asked = self._ground.readings.asked
        return free_parameters(asked.found.assembly, asked.experiments[0], asked.states[0], variant)

    def __call__(self, samples: Samples, options: Sequence[Option], null: Null | None = None) -> Judged | None:
        """The best point of an effect's grid and set of amplitudes; None where the baseline can mimic every point.

        Where no point gains anything, as where friction would have to be negative, it is the grid's middle.
        """
        best: tuple[float, float, int, NDArray[np.int_], Array, Case] | None = None
        options = [(v, own) for v, own in options if own]
        if not options:
            return None
        middle = len(options) // 2
        cases = sorted(enumerate(samples.cases(options)), key=lambda numbered: abs(numbered[0] - middle))
        for subset in options[0][0].subsets():
            price = self._price(reduced(options[0][0], subset))
            for number, whole in cases:
                case = whole.only(subset)
                gain = case.gain()
                if gain.mimicked:
                    continue
                if best is None or gain.total - price > best[0]:
                    best = (gain.total - price, price, number, subset, gain.amplitudes[: len(subset)], case)
                if null is not None:
                    null.enter(case.reached, samples.evidence.null_gains(case.own) - price)
        if best is None:
            return None
        score, price, number, subset, amplitudes, case = best
        variant = reduced(options[number][0], subset)
        own = {c: [x[:, subset] for x in parts] for c, parts in options[number][1].items()}
        columns = {c: self._ground.noise.whiten(c, parts) for c, parts in own.items()}
        explained = samples.explained(variant, own)
        everywhere = self._ground.readings.everywhere.columns
        return Judged(
            variant, variant.placed, amplitudes, score, price, explained, tuple(own), case, columns, everywhere
        )

    def _price(self, variant: Variant) -> float:
        """What a gain with so many parameters pays; the same all over an effect's grid."""
        key = variant.amplitudes.tobytes()
        if key not in self._prices:
            self._prices[key] = 0.5 * self._log_size * len(self.free(variant))
        return self._prices[key]

    def beyond_noise(self, j: Judged, samples: Samples, reading: Reading) -> float:
        """Share of its joint's own residual that a drive explains, less what the encoders' noise may account for."""
        own = reading.found.assembly.joint_of(j.placed)
        explained = samples.explained(j.variant, {own: reading.columns(j.variant)[own]})
        return explained - UNEVEN * self._ground.heard[own]

    def along_measured(self, grid: Sequence[Variant]) -> Judged | None:
        """A drive's spring or play along the motion as measured, its shape tuned; None where it explains too little."""
        samples, reading = self._ground.measured, self._ground.readings.measured

        def judged(some: Sequence[Variant]) -> Judged | None:
            return self(samples, [(v, reading.columns(v)) for v in some])

        j = _tuned(judged(grid), judged)
        return j if j is not None and self.beyond_noise(j, samples, reading) > DRIVEN_MOST else None


def _tuned(best: Judged | None, judge: Callable[[Sequence[Variant]], Judged | None]) -> Judged | None:
    """The best candidate near a point of its grid: every shape up or down, by ever smaller factors."""
    if best is None:
        return None
    for factor in 1.8 ** (0.5 ** np.arange(TUNINGS)):
        shape = best.variant.parameters
        near = [
            shape * np.where(np.arange(len(shape)) == i, f, 1.0)
            for i in range(len(shape))
            for f in (factor, 1 / factor)
        ]
        other = judge([replace(best.variant, parameters=x) for x in near])
        if other is not None and other.score > best.score:
            best = other
    return best
