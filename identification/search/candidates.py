"""Which effects could be missing, at which places, and the columns each would add to the torque."""

import functools
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ...models.effect import Effect, Parameter, term
from ...models.effects import MOST_TERMS, effects
from ...models.model import Model, PlacedEffect, all_places, effect_on
from ..fitting.assembly import TorqueEvaluation, TorqueModel
from ..fitting.effect_places import EffectTerms, TorqueState
from ..fitting.experiment import Experiment
from ..fitting.problem import reached

Array = NDArray[np.float64]

MOST_VARIANTS = 36
"""Grid points of one effect at one place; a finer grid is thinned evenly."""

MOST_OF_WHOLE = 1.6
"""Most that a law's whole contribution at a point of its grid is multiplied by: beyond, another point is meant."""

MOST_COMBINED = 4
"""Most columns of a link effect of which every combination is tried."""


@dataclass(frozen=True)
class EffectVariant:
    """One effect at one place with its shape parameters set.

    ``amplitudes`` are the parameters the law is linear in, whose columns are tried, between ``low`` and ``high``; where
    there is none (a delay, a spring), the law's whole contribution is the one column. The place of a mass on a link has
    its slope tried beside the mass, which makes (mass, mass * x, mass * y, mass * z) amplitudes. Where they are held in
    the ratios ``together``, one column stands for all.
    """

    placed: PlacedEffect
    parameters: Array
    amplitudes: NDArray[np.int_]
    low: Array
    high: Array
    together: Array | None = None

    @property
    def count(self) -> int:
        """Columns that stand for the law."""
        return 1 if self.together is not None else max(len(self.amplitudes), 1)

    def subsets(self) -> list[NDArray[np.int_]]:
        """Positions of the columns to try together: all and single ones; of a vector's few components, every set; of
        many components, those of one unit; of amplitudes that exclude each other, single ones."""
        n = max(len(self.amplitudes), 1)
        parameters = [self.placed.effect.parameters[i] for i in self.amplitudes]
        alone = {k for k, p in enumerate(parameters) if p.alone and not p.grid}
        if not alone:
            return [np.arange(n)]
        effect = self.placed.effect
        counts = range(1, n + 1) if effect.at == "link" and n <= MOST_COMBINED else sorted({1, n})
        counts = (1,) if effect.exclusive else counts
        found = [np.array(some) for k in counts for some in combinations(range(n), k) if alone & set(some)]
        if effect.at == "link" and n > MOST_COMBINED:
            units = [p.unit for p in parameters]
            alike = [np.flatnonzero([u == unit for u in units]) for unit in dict.fromkeys(units)]
            found += [some for some in alike if 1 < len(some) < n]
        return found

    def start(self, amplitudes: Array) -> Array:
        """All parameters of the effect (p,) for amplitudes found."""
        full = self.parameters.copy()
        if self.together is not None:
            full[self.amplitudes] = amplitudes[0] * self.together
        elif len(self.amplitudes):
            full[self.amplitudes] = amplitudes
            slopes = [i for i in self.amplitudes if self.placed.effect.parameters[i].grid]
            masses = [i for i in self.amplitudes if not self.placed.effect.parameters[i].grid]
            full[slopes] /= np.max(full[masses], initial=0.0) or 1.0
        return full


def shifts(p: PlacedEffect) -> str | None:
    """The joint whose torque an effect makes late or early against its motion, if it does that."""
    kind, _, joint = p.at.partition(".")
    return joint if p.effect.at == "sensor" and p.effect.states and kind in ("tau", "q") else None


def library(model: Model) -> list[PlacedEffect]:
    """Every effect at every place that the model does not have and that its kind of inertia allows."""
    have = {p.key for p in model.effects}
    for p in model.effects:
        if p.effect.at == "slide" and p.at == model.joints[0]:
            # The first joint's slides act on it alone, so that the same law at the joint is the same column.
            have |= {f"{name}.{p.at}" for name in _at_joints(p.effect)}
    shifted = {shifts(p) for p in model.effects}
    found = []
    for effect in (effect_on(e, model.tree) for e in effects().values()):
        if effect.at == "link" and model.inertia == "free":
            continue  # the identified inertia already holds whatever a link effect could add
        if model.inertia == "free" and len(model.joints) == 1 and _scales(effect):
            continue  # a factor on the one torque is a factor on all that is identified
        spots = all_places(effect, model.tree)
        if effect.at == "sensor" and effect.states:
            # A joint's torque is late against its motion, or early (a command, a late encoder): one shift of the two.
            arm = [j for j in model.joints[model.tree.carriers :] if j not in shifted]
            spots = tuple(f"{kind}.{j}" for kind in (("tau",) if effect.leads else ("tau", "q")) for j in arm)
        found += [PlacedEffect(effect, at) for at in spots if f"{effect.name}.{at}" not in have]
        if effect.series:
            found += _further(effect, spots, have)
    return found


def _further(effect: Effect, spots: Sequence[str], have: set[str]) -> list[PlacedEffect]:
    """The next term of a series at each place that has those before it."""
    found = []
    for at in spots:
        names = [effect.name, *(f"{effect.name}_{k}" for k in range(2, MOST_TERMS + 1))]
        there = [f"{name}.{at}" in have for name in names]
        if there[0] and not all(there):
            found.append(PlacedEffect(term(effect, there.index(False) + 1), at))
    return found


@functools.cache
def _scales(effect: Effect) -> bool:
    """Does a sensor multiply its reading by a factor, and no more?"""
    if effect.at != "sensor" or effect.states:
        return False
    signals = defaultdict(lambda: ca.SX.sym("another"), {"value": ca.SX.sym("value")})
    law = effect.law(signals, {p.name: ca.SX(p.zero + 0.1) for p in effect.parameters})
    if len(signals) > 1:
        return False
    read = ca.Function("read", [signals["value"]], [law])
    return float(read(0)) == 0 and abs(float(read(3)) - 3 * float(read(1))) < 1e-12


def _at_joints(effect: Effect) -> list[str]:
    """Joint effects of the same law, and what these contain."""
    same = [x for x in effects().values() if x.at == "joint" and x.law is effect.law]
    return [name for x in same for name in (x.name, *x.contains)]


def variants(assembly: TorqueModel, placed: PlacedEffect) -> list[EffectVariant]:
    """The grid over an effect's shape parameters at a place, amplitudes at zero."""
    axes, amplitudes = [], []
    for i, p in enumerate(placed.effect.parameters):
        scale, origin = assembly.scale(placed, p), assembly.origin(placed, p)
        axes.append([origin + g * scale for g in p.grid] or [p.zero * scale])
        if _is_linear(p):
            amplitudes.append(i)
    masses = [i for i in amplitudes if not placed.effect.parameters[i].grid]
    if len(masses) < len(amplitudes):  # slopes are taken at one kilogram
        axes = [[1.0] if i in masses else axis for i, axis in enumerate(axes)]
    index = np.array(amplitudes, int)
    bounds = [assembly.bounds(placed, placed.effect.parameters[i]) for i in index] or [(0.0, MOST_OF_WHOLE)]
    low, high = (np.array(x, float) for x in zip(*bounds, strict=True))
    grid = list(product(*axes))
    step = -(-len(grid) // MOST_VARIANTS)
    found = [EffectVariant(placed, np.array(g, float), index, low, high) for g in grid[::step]]
    if 1 < len(masses) < len(amplitudes):
        # A mass for each axis: one that moves along a single axis has slopes of its own.
        others = [[], *([i for i in masses if i != alone] for alone in masses)]
        found = [replace(v, parameters=_with_zeros(v.parameters, where)) for v in found for where in others]
    return found


def reduced(variant: EffectVariant, subset: NDArray[np.int_]) -> EffectVariant:
    """A variant with only some of its amplitudes, by their positions."""
    if not len(variant.amplitudes):
        return variant
    some = variant.amplitudes[subset]
    return replace(variant, amplitudes=some, low=variant.low[subset], high=variant.high[subset])


def _with_zeros(parameters: Array, where: list[int]) -> Array:
    changed = parameters.copy()
    changed[where] = 0.0
    return changed


def candidate_columns(
    assembly: TorqueModel, experiment: Experiment, state: TorqueEvaluation, variant: EffectVariant
) -> list[tuple[int, Array]]:
    """Columns that a variant adds to each channel that it reaches, in the analysis band: (channel, (n_band, k))."""
    placed = variant.placed
    effect = placed.effect
    key = None
    if effect.at == "joint" and not effect.states and not any(state.passed.get(c) for c in reached(assembly, placed)):
        key = ("candidate", placed.key, variant.parameters.tobytes(), variant.amplitudes.tobytes())
        if key in experiment.store:
            return experiment.store[key]
    terms, by_load, _ = _terms(assembly, experiment, state, placed, variant.parameters, not len(variant.amplitudes))
    found = []
    for channel, values, columns in terms:
        own = columns[:, variant.amplitudes] if len(variant.amplitudes) else values[:, None]
        if effect.at != "sensor":
            for passed in state.passed.get(channel, ()):
                own = passed(own)
        found.append((channel, experiment.to_band(own, channel)))
    if key is not None and by_load is None:
        experiment.store[key] = found
    return found


def _terms(
    assembly: TorqueModel,
    experiment: Experiment,
    state: TorqueEvaluation,
    placed: PlacedEffect,
    parameters: Array,
    bare: bool = False,
) -> EffectTerms:
    """What an effect adds beside the model as evaluated."""
    return assembly.at(placed).terms(TorqueState(experiment, state.load, state.tau), parameters, bare)


def free_parameters(
    assembly: TorqueModel, experiment: Experiment, state: TorqueEvaluation, variant: EffectVariant
) -> tuple[str, ...]:
    """Names of the parameters that matter once the variant's amplitudes are switched on.

    A shape that only acts through an amplitude left at zero has no derivative, and is not counted.
    """
    placed = variant.placed
    parameters = variant.parameters.copy()
    parameters[variant.amplitudes] = 1.0
    terms = _terms(assembly, experiment, state, placed, parameters).terms
    moves = np.any([np.any(columns, axis=0) for _, _, columns in terms], axis=0)
    amplitudes = {p.name for p in placed.effect.parameters if _is_linear(p) and len(variant.amplitudes)}
    on = {placed.effect.parameters[i].name for i in variant.amplitudes}
    return tuple(
        p.name
        for p, moving in zip(placed.effect.parameters, moves, strict=True)
        if moving and (p.name in on or p.name not in amplitudes)
    )


def _is_linear(parameter: Parameter) -> bool:
    """Whether a column stands for the parameter: an amplitude, or a mass's place, whose grid is its origin alone."""
    return not parameter.grid or parameter.grid == (0.0,)
