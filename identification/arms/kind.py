"""Recordings of an arm, fixed, floating or suspended, as a decision sees them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model, PlacedEffect
from ..deciding import DRIVEN
from ..decision.kind import Chosen
from ..decision.selection import Naming, Selection
from ..evidence.forecast import Forecast
from ..evidence.members import log_bayes
from ..evidence.projected import ProjectedEvidence
from ..evidence.search import MemberOdds, Search
from ..evidence.weighed import WeighedRecordings
from ..fitting.base_parameters import BaseParameters
from ..fitting.experiment import Experiment, Scales
from ..fitting.fit import Fit, channel_rms, fit
from ..nuisance.bursts import Bursts
from ..search.candidates import free_parameters, library
from ..search.closed_loop import planned
from ..search.refit import assemble, refitted, without
from ..search.rest import fitted
from .blocks import blocks
from .bursts import bursts_of
from .choice import together
from .forecast import along_instruments, forecast, known_to
from .laws import rings
from .weigh import weigh

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ArmFit:
    """A model of an arm as fitted, and all recordings along the instrument motion."""

    model: Model
    fit: Fit
    instruments: tuple[Experiment, ...]
    tuned: Mapping[str, Array]
    """Parameters of every law that rings, by its key, fitted on top of the model as given by itself."""


@dataclass(frozen=True, eq=False)
class ArmRecordings:
    """Recordings of an arm.

    Parameters
    ----------
    model : Model
        As given.
    base : BaseParameters or None
        With ``inertia = "free"``.
    scales : mapping of str to Scales
    training, held_out : sequence of Experiment
    seed : int
        Of random starts.
    """

    model: Model
    base: BaseParameters | None
    scales: Mapping[str, Scales]
    training: Sequence[Experiment]
    held_out: Sequence[Experiment]
    seed: int = 0

    @property
    def train(self) -> range:
        """Numbers of the training recordings."""
        return range(len(self.training))

    @property
    def held(self) -> range:
        """Numbers of the held-out recordings."""
        return range(len(self.training), len(self.every))

    @property
    def every(self) -> list[Experiment]:
        """All recordings."""
        return [*self.training, *self.held_out]

    def first(self, progress: Callable[[str], None]) -> ArmFit:
        """The baseline's fit."""
        progress("fitting the baseline")
        assembly = assemble(self.model, self.base, self.scales)
        found = fit(assembly, fitted(assembly, self.training), progress=progress, seed=self.seed)
        return ArmFit(self.model, found, self._along(found), self._tuned(found))

    def _along(self, found: Fit, before: Sequence[Experiment] | None = None) -> tuple[Experiment, ...]:
        return tuple(planned(found, self.training, before, others=self.held_out, driven=DRIVEN))

    def _tuned(self, first: Fit) -> dict[str, Array]:
        """Between two points of a grid over its frequency a law that rings explains nothing."""
        found = {}
        for p in library(self.model):
            if rings(p):
                assembly = assemble(self.model.with_effects([p], {}), self.base, self.scales)
                alone = refitted(first, assembly, fitted(assembly, self.training), True, self.seed)
                found[p.key] = alone.theta[assembly.index_of(p)]
        return found

    def fitted(
        self, before: ArmFit, placed: Sequence[PlacedEffect], values: Mapping[str, float], weighed: WeighedRecordings
    ) -> ArmFit:
        """The fit with more effects."""
        model = before.model.with_effects(placed, values)
        assembly = assemble(model, self.base, self.scales)
        samples = fitted(assembly, self.training)
        found = refitted(before.fit, assembly, samples, any(rings(p) for p in placed), self.seed)
        return ArmFit(model, found, self._along(found, before.instruments), before.tuned)

    def closed(self, last: ArmFit, weighed: WeighedRecordings) -> ArmFit:
        """The baseline is fitted from the first."""
        return last

    def without(self, found: Selection[ArmFit], fit: ArmFit, key: str) -> ArmFit:
        """The fit without an effect."""
        model = replace(fit.model, effects=tuple(p for p in fit.model.effects if p.key != key))
        return replace(fit, model=model, fit=without(fit.fit, [key], self.training, found.first.fit))

    def known(self, found: Selection[ArmFit], fit: ArmFit, whole: Forecast) -> ArmFit:
        """The fit with the evidence's deviations: a nameless curve is what names leave, their values do not wait for
        it."""
        told = self.forecast(replace(found, slots=()), fit) if found.nameless else whole
        return replace(fit, fit=known_to(fit.fit, told))

    def residuals(self, fit: ArmFit) -> list[Array]:
        """Of each training recording along the motion as measured (n_band, J)."""
        return self._residuals(fit, self.training)

    def _residuals(self, fit: ArmFit, experiments: Sequence[Experiment]) -> list[Array]:
        return [fit.fit.assembly.residual(e, fit.fit.theta)[0] for e in experiments]

    def weighed(self, fit: ArmFit, known: WeighedRecordings | None, *, anew: bool = False) -> WeighedRecordings:
        """The recordings with every hypothesis; noise is learnt once, beside all that could explain a residual."""
        noises = None if known is None else known.noises
        n = len(self.training)
        return weigh(fit.model, fit.fit, self.every, fit.instruments, n, self.scales, noises, tuned=fit.tuned)

    def chosen(self, made: Search, slots: Sequence[MemberOdds], large: Sequence[MemberOdds]) -> list[Chosen]:
        """All large names together."""
        return together(made, slots, large)

    def started(
        self, fit: ArmFit, made: Search, slot: MemberOdds, amplitudes: Array
    ) -> tuple[PlacedEffect, dict[str, float]]:
        """An effect, with what cannot be determined held, and its parameters' start."""
        assembly, experiment = fit.fit.assembly, fit.instruments[0]
        item, label = made.on.evidence.items[slot.taken.item], made.pool[slot.taken.hypothesis].label
        variant = item.label
        values = variant.start((item.spread * amplitudes)[: variant.count])
        free = free_parameters(assembly, experiment, assembly.evaluate(experiment, fit.fit.theta), variant)
        placed = replace(label, hold=tuple(p.name for p in label.effect.parameters if p.name not in free))
        pairs = zip(placed.effect.parameters, values, strict=True)
        return placed, {f"{placed.key}.{p.name}": float(v) for p, v in pairs}

    def smallest(self, made: Search, hypothesis: int) -> dict[str, float]:
        """The value of each amplitude by itself from which on the name would have had a posterior above a half.

        That is where its best log Bayes factor, with the score H t that it then makes, outweighs its prior odds.
        """
        x, found = made.pool[hypothesis], {}
        middle = x.items[len(x.items) // 2].label.parameters
        start = sum(len(y.items) for y in made.pool[:hypothesis])
        for number, item in enumerate(x.items, start):
            variant = item.label
            if len(variant.amplitudes) != 1 or not np.array_equal(variant.parameters, middle):
                continue
            parameter = variant.placed.effect.parameters[int(variant.amplitudes[0])]
            curvature = made.on.own(number)[:1, :1]
            if not parameter.alone or parameter.grid or curvature[0, 0] <= 1e-12:
                continue
            t = np.geomspace(1e-4, 100.0, 600)
            many = np.broadcast_to(curvature, (len(t), 1, 1))
            gain = log_bayes(many, curvature[0] * t[:, None], np.tile(item.positive[:1], (len(t), 1))).max(axis=1)
            enough = np.flatnonzero(gain + x.prior > 0)
            if len(enough):
                found[parameter.name] = float(t[enough[0]] * item.spread[0])
        return found

    def forecast(self, found: Selection[ArmFit], fit: ArmFit) -> Forecast:
        """The held-out recordings as a fit predicts them."""
        return forecast(found, fit.model, fit.fit, self.every, self.scales)

    def forecast_without(self, found: Selection[ArmFit], name: Naming, fit: ArmFit, rest: ArmFit) -> Forecast:
        """As the rest of a fit does, as far as the instrument motion tells the two apart."""
        residuals = along_instruments(fit.fit, rest.fit, self.every, found.last.instruments)
        return forecast(found, rest.model, rest.fit, self.every, self.scales, residuals)

    def apart(self, one: ArmFit, other: ArmFit) -> Array:
        """RMS difference of two models' torques, in the analysis band [share of the channel's RMS] (J,)."""
        torques = [[e.all_to_band(x.fit.assembly.torque(e, x.fit.theta)) for e in self.held_out] for x in (one, other)]
        counted = np.maximum(np.sum([e.counted for e in self.held_out], axis=0), 1)
        apart = np.concatenate(torques[0]) - np.concatenate(torques[1])
        _, measured = channel_rms(one.fit.assembly, self.held_out, one.fit.theta)
        return np.sqrt(np.sum(apart**2, axis=0) / counted) / measured

    def with_held(
        self, found: Selection[ArmFit], fit: ArmFit, items: Sequence[int]
    ) -> tuple[ProjectedEvidence, dict[int, int]]:
        """The evidence of some items on all recordings, whose columns are there already."""
        some = found.search.on.evidence.of_items(items)
        both = ProjectedEvidence(some, range(len(self.every)), found.weighed.beside.weight(found.tolerance))
        return both, {item: k for k, item in enumerate(items)}

    def blocks(self, i: int, x: Array) -> Array:
        """Sums over blocks of time."""
        return blocks(self.every[i], x)

    def bursts(self, found: Selection[ArmFit]) -> dict[int, Bursts]:
        """Of every channel; on a suspension or a floating base every joint moves what carries the others, which rings
        as it likes: nothing is said there."""
        return bursts_of(found, self.training, self.held_out) if self.model.tree.stands else {}
