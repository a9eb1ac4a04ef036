"""What has no name, modelled all the same: tables for the nameless curves that a diagnosis is left with.

A table holds only what no law of the baseline can (`tabulating`), whose parameters are fitted again beside it. What was
named keeps the values that the recordings confirmed: a table that is nearly a sum of laws must not change them (a cut
between modules: Liu, Bayarri and Berger 2009). The held-out recordings confirm the table, by the density that they have
with it and without.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..models.empirical import NAME, placed_tables, read_along, tables_of
from ..models.model import PlacedEffect
from ..models.table import Table, read_words
from .arms.blocks import blocks
from .arms.kind import ArmFit
from .deciding import GATE
from .decision.decide import Decision
from .evidence.gain import Remaining, scatter
from .fitting.assembly import FreeParameter, TorqueModel
from .fitting.experiment import Experiment
from .fitting.fit import Fit, fit
from .fitting.problem import gather
from .search.refit import carry
from .search.rest import fitted
from .tabulating import Rest, tabulate

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EmpiricalLaw:
    """Tables found at one joint with their values and deviations, and what the held-out recordings gain by them
    [log density, and its standard errors]."""

    at: str
    tables: tuple[Table, ...]
    values: Mapping[str, float]
    gain: float
    sure: float


def empirical_laws(
    decided: Decision[ArmFit], final: Fit, train: Sequence[Experiment], held: Sequence[Experiment]
) -> tuple[Fit, tuple[EmpiricalLaw, ...]]:
    """The fit with a table for each nameless curve that can be one and that the held-out recordings confirm."""
    carriers, joints = final.assembly.tree.carriers, final.assembly.tree.joints
    found: list[EmpiricalLaw] = []
    named = {n.placed.key for n in decided.best.names}
    for c in sorted({r.channel for r in decided.left.curves if r.channel >= carriers}):
        curves = [r for r in decided.left.curves if r.channel == c]  # what explains most comes first
        wanted = list(dict.fromkeys(x for x in (read_words(r.over) for r in curves) if x))
        at = joints[c].name
        if any(p.effect.name == NAME and p.at == at for p in final.assembly.placed):
            continue
        # Tables that are not confirmed together may be without the least of them, or by themselves.
        for some in (*(wanted[:k] for k in range(len(wanted), 0, -1)), *([x] for x in wanted[1:])):
            tables, values = _tables(decided, final, train, c, some, named)
            other = _refitted(final, placed_tables(at, tables), values, train, named)
            gain, sure = _confirmed(decided, final, other, train, held, c)
            if sure > GATE:
                final = other
                found.append(EmpiricalLaw(at, tables, values, gain, sure))
                break
    return final, tuple(found)


def _tables(
    decided: Decision[ArmFit],
    final: Fit,
    train: Sequence[Experiment],
    c: int,
    wanted: Sequence[tuple[tuple[str, ...], str]],
    named: Collection[str],
) -> tuple[tuple[Table, ...], dict[str, float]]:
    """Tables over the coordinates wanted, with their values and deviations by key."""
    assembly, at = final.assembly, final.assembly.tree.joints[c].name
    covariances = [row[c].covariance for row in decided.best.found.weighed.evidence.channels]
    size = float(decided.best.found.weighed.scale[c])
    rests = []
    for e, covariance in zip(train, covariances, strict=False):  # the held-out recordings' come last
        residual, own = assembly.residual(e, final.theta)
        index, columns = gather(own, c)
        baseline = [k for k, i in enumerate(index) if _effect_of(assembly.slots[i]) not in named]
        always = columns.reshape(len(residual), -1)[:, baseline]
        rests.append(Rest(residual[:, c], always, partial(e.to_band, channel=c), covariance.solve))
    loads = [assembly.evaluate(e, final.theta).load for e in train]
    reads = [
        [_read(assembly, e, load, c, over, times) for e, load in zip(train, loads, strict=True)]
        for over, times in wanted
    ]
    return tabulate(at, wanted, reads, rests, size)


def _read(assembly: TorqueModel, e: Experiment, load: Array, c: int, over: tuple[str, ...], times: str) -> list[Array]:
    """Coordinates of a table at a joint along a recording, each (n,), and last its factor, as the law reads them."""
    m, names = e.motion, [j.name for j in assembly.tree.joints]
    steps = np.abs(m.qd[:, c]) * m.period
    signals = {"q": m.q[:, c], "qd": m.qd[:, c], "load": load[:, c], "time": e.elapsed}
    signals["travelled"] = np.concatenate([np.cumsum(steps[s]) - 0.5 * (steps[s][0] + steps[s]) for s in m.segments])
    signals["speed_scale"] = np.full(len(steps), assembly.values(assembly.start)[f"speed_scale.{names[c]}"])
    for k, joint in enumerate(Table(over, times, ()).others, 1):
        i = names.index(joint)
        signals |= {f"q_of_{k}": m.q[:, i], f"qd_of_{k}": m.qd[:, i]}
    found = read_along(over, times).call({name: x[None, :] for name, x in signals.items()})
    return [np.asarray(x, float).ravel() for x in (*(found[f"x{k}"] for k in range(len(over))), found["factor"])]


def _refitted(
    final: Fit, placed: PlacedEffect, values: Mapping[str, float], train: Sequence[Experiment], named: Collection[str]
) -> Fit:
    """The baseline fitted again beside a table and the named laws, which are held."""
    before = final.assembly
    known = before.values(final.theta) | {k: v for k, v in values.items() if k.startswith(f"{NAME}.")}

    def assembled(effects: Sequence[PlacedEffect], values: Mapping[str, float]) -> TorqueModel:
        made = TorqueModel(before.tree, (*effects, placed), before.base, before.scales, values)
        made.phi = before.phi
        return made

    held = [replace(p, hold=tuple(x.name for x in p.effect.parameters)) if p.key in named else p for p in before.placed]
    part = assembled(held, known)
    own = fit(part, fitted(part, train), start=carry(final, part), multi_start=False)
    whole = assembled(before.placed, known | part.values(own.theta))
    theta, std, at_bound = carry(own, whole), np.zeros(len(whole.slots)), np.zeros(len(whole.slots), bool)
    covariance = np.zeros((len(theta), len(theta)))
    for f in (final, own):
        where = {s.key: i for i, s in enumerate(f.assembly.slots)}
        rows = [(i, where[s.key]) for i, s in enumerate(whole.slots) if s.key in where]
        to, of = (np.array(k, int) for k in zip(*rows, strict=True)) if rows else (np.zeros(0, int),) * 2
        std[to], at_bound[to], covariance[np.ix_(to, to)] = f.std[of], f.at_bound[of], f.covariance[np.ix_(of, of)]
    return replace(own, assembly=whole, theta=theta, std=std, at_bound=at_bound, covariance=covariance)


def _effect_of(of: FreeParameter) -> str:
    return f"{of.effect}.{of.at}"


def _confirmed(
    decided: Decision[ArmFit], before: Fit, after: Fit, train: Sequence[Experiment], held: Sequence[Experiment], c: int
) -> tuple[float, float]:
    """Log density that the held-out recordings gain on a channel, and that in its standard errors over blocks; of the
    samples for which the tables have data. Elsewhere they hold their end values, which is no prediction."""
    rows = decided.best.found.weighed.evidence.channels[len(train) :]
    inside = [np.round(e.to_band(_known(after, e, c), c))[:, None] for e in held]
    without, with_it = (
        [
            Remaining.of([f.assembly.residual(e, f.theta)[0][:, c]], [row[c].covariance]).at(here)
            for e, row, here in zip(held, rows, inside, strict=True)
        ]
        for f in (before, after)
    )
    gain = 0.5 * sum(float(np.sum(a.energy - b.energy)) for a, b in zip(without, with_it, strict=True))
    return gain, gain / max(scatter(without, with_it, [partial(blocks, e) for e in held]), 1e-12)


def _coordinates(
    assembly: TorqueModel, e: Experiment, theta: Array
) -> Iterator[tuple[str, str, Array, Sequence[float]]]:
    """Of each table's coordinates: its joint, the coordinate's name, its values along a motion (n,), and its knots."""
    for p in assembly.placed:
        for t in tables_of(p.effect):
            load = assembly.evaluate(e, theta).load
            read = _read(assembly, e, load, assembly.joint_of(p), t.over, t.times)[:-1]
            yield from ((p.at, *x) for x in zip(t.over, read, t.knots, strict=True))


def _known(final: Fit, e: Experiment, c: int) -> Array:
    """1 along a motion where a joint's tables have data, 0 elsewhere (n,)."""
    assembly, found = final.assembly, np.ones(len(e.motion.time))
    for at, _, x, knots in _coordinates(assembly, e, final.theta):
        if at == assembly.tree.joints[c].name:
            found[(x < knots[0]) | (x > knots[-1])] = 0.0
    return found


def beyond(assembly: TorqueModel, e: Experiment, theta: Array) -> list[str]:
    """For each table that a motion leaves the data of: one line that says so, and that it is held there."""
    return [
        f"the empirical law at {at} has data for {name} from {knots[0]:.4g} to {knots[-1]:.4g}; the motion goes from "
        f"{x.min():.4g} to {x.max():.4g}: outside, its end value is held"
        for at, name, x, knots in _coordinates(assembly, e, theta)
        if np.any((x < knots[0]) | (x > knots[-1]))
    ]
