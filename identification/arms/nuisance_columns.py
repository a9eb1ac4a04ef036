"""Columns that stand beside every explanation: the baseline's parameters, the tolerance of the masses, small curves."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.model import PlacedEffect
from ...models.regressor import OWN
from ..deciding import BASELINE, BASELINE_OWN, BASELINE_SHAPE, BENDS, DISCREPANCY, LAW_ERROR
from ..evidence.pool import CandidateColumns, Curves
from ..evidence.weighed import NuisanceColumns, Part
from ..fitting.assembly import TorqueModel
from ..fitting.experiment import Experiment
from ..fitting.fit import Fit
from ..fitting.problem import gather
from ..nuisance.curve import SMALL, over_decades
from ..search.refit import carry
from .hypotheses import ColumnSource, coordinate, lagging, remembers, starts
from .whole_mass import by_mass

Array = NDArray[np.float64]


def beside(
    along: ColumnSource,
    found: Fit,
    by_words: Curves,
    columns: CandidateColumns,
    nameless: Mapping[tuple[int, str], float],
) -> NuisanceColumns:
    """All nuisance columns of some recordings under a fit; ``nameless`` curves have their own sizes."""
    assembly, n, n_channels = found.assembly, along.n_train, len(along.scale)
    blocks = [assembly.residual(e, found.theta)[1] for e in along.instruments]
    baseline = [
        [_filled(gather(b, c), len(e.measured)) for c in range(n_channels)]
        for b, e in zip(blocks, along.instruments, strict=True)
    ]
    spread = _spread(found, baseline[:n], along.scale)
    parts: list[list[list[Part]]] = [[[(index, x * spread[index])] for index, x in row] for row in baseline]
    count = len(found.theta)
    tolerant = slice(count, count)
    if assembly.base is None:
        one = inertial_part(assembly)
        tolerant = slice(count, count + len(one))
        for row, e in zip(parts, along.instruments, strict=True):
            for c, own in enumerate(row):
                at, felt = regressor_columns(e, c)
                scale = by_mass(assembly, e, c)
                if scale is not None:
                    felt = felt + scale[:, None] * (at % OWN == 0)
                own.append((tolerant.start + at, felt * one[at]))
        count = tolerant.stop
    sizes = _small(found, baseline[:n], along.scale)
    for (c, words), item in by_words.items():
        size = float(np.hypot(sizes.get((c, words), 0.0), nameless.get((c, words), 0.0)))
        if size > 0:
            for i, row in enumerate(parts):
                index = count + np.arange(len(item.index))
                row[c].append((index, columns.some(i, c, item.index) * (size * item.spread)))
            count += len(item.index)
    for p in assembly.placed:
        if not remembers(p):
            continue
        rest = assembly.keep([x for x in assembly.placed if x.key != p.key], found.theta)
        left = carry(found, rest)
        made = [e.motion.to_band(assembly.torque(e, found.theta) - rest.torque(e, left)) for e in along.instruments]
        item = lagging(along, {c: [x[:, [c]] for x in made] for c in range(n_channels)}, columns)
        rms = np.sqrt(np.mean(np.concatenate(made[:n]) ** 2, axis=0))
        size = BENDS[0] * float(np.max(rms / along.scale)) * item.spread
        for i, row in enumerate(parts):
            for c in range(n_channels):
                row[c].append((count + np.arange(2), columns.some(i, c, item.index) * size))
        count += 2
    for k, p in enumerate(assembly.placed):
        made = starts(along, p, assembly.parameters(k, found.theta))
        most = max((x.shape[1] for own in made.values() for x in own), default=0)
        for c, own in made.items():
            for row, x in zip(parts, own, strict=True):
                row[c].append((count + np.arange(most), x))
        count += most
    for p in assembly.placed:
        if p.effect.at == "joint" or coordinate(p.effect) is None:
            continue
        made = _error_of_force(along, found, p)
        k = made[0][0][1].shape[1]
        for row, own in zip(parts, made, strict=True):
            for c, x in own:
                row[c].append((count + np.arange(k), x))
        count += k
    joined = [[_joined(own) for own in row] for row in parts]
    return NuisanceColumns(joined, count, tolerant, baseline, spread)


def _small(found: Fit, baseline: Sequence[Sequence[Part]], scale: Array) -> dict[tuple[int, str], float]:
    """Sizes of the small curves beside every explanation, by channel and words [RMS torque of the channel].

    No law of the model is exact: a curve over what it runs over is a share of what the law does there.
    """
    sizes = {(c, words): DISCREPANCY**2 for c in range(len(scale)) for words in SMALL}
    assembly, shapes = found.assembly, _shapes(found.assembly)
    for p in assembly.placed:
        words = coordinate(p.effect)
        own = [int(i) for i in assembly.index_of(p) if not shapes[i]]
        if words is None or p.effect.at != "joint" or not own:
            continue
        c = assembly.joint_of(p)
        index = baseline[0][c][0]
        at = [int(np.flatnonzero(index == i)[0]) for i in own if i in index]
        torque = np.concatenate([row[c][1][:, at] @ found.theta[index[at]] for row in baseline])
        share = float(np.sqrt(np.mean(torque**2))) / scale[c]
        sizes[c, words] = sizes.get((c, words), 0.0) + (LAW_ERROR * share) ** 2
    return {key: float(np.sqrt(v)) for key, v in sizes.items()}


def _error_of_force(along: ColumnSource, found: Fit, p: PlacedEffect) -> list[list[tuple[int, Array]]]:
    """What friction that several channels feel has wrong, as a curve over the speed of the joint that it goes with, on
    a logarithmic scale: most of it is near rest. Of each recording, channels and columns (n, k) in units of their prior
    deviation, `LAW_ERROR` of the friction."""
    assembly, n, c = found.assembly, along.n_train, found.assembly.joint_of(p)
    place, made = assembly.at(p), []
    for e, x in zip(along.instruments, along.coordinates(c), strict=True):
        own = over_decades(x)
        terms = place.spread(e, np.zeros((len(own), 1)), own[:, None, :])
        made.append([(at, e.to_band(columns, at)) for at, _, columns in terms])
    rest = assembly.keep([x for x in assembly.placed if x.key != p.key], found.theta)
    left = carry(found, rest)
    law = [
        e.motion.to_band(assembly.torque(e, found.theta) - rest.torque(e, left))[:, c] for e in along.instruments[:n]
    ]
    unit = [x for row in made[:n] for at, x in row if at == c]
    size = np.sqrt(np.mean(np.concatenate(law) ** 2) / np.mean(np.sum(np.concatenate(unit) ** 2, axis=1)))
    return [[(at, LAW_ERROR * size * x) for at, x in row] for row in made]


def _filled(part: Part, n: int) -> Part:
    index, x = part
    return (index, x) if len(index) else (index, np.zeros((n, 0)))


def _joined(own: Sequence[Part]) -> Part:
    return np.concatenate([index for index, _ in own]), np.concatenate([x for _, x in own], axis=1)


def _spread(found: Fit, baseline: Sequence[Sequence[Part]], scale: Array) -> Array:
    """Prior deviation of each of the baseline's parameters about its fit (P,)."""
    size = np.zeros(len(found.theta))
    for c in range(len(scale)):
        index = baseline[0][c][0]
        if len(index):
            rms = np.sqrt(np.mean(np.concatenate([row[c][1] for row in baseline]) ** 2, axis=0))
            np.maximum.at(size, index, rms / scale[c])
    own = np.abs(found.theta)
    spread = np.where(size > 0, BASELINE_OWN * own + BASELINE / np.maximum(size, 1e-12), 0.0)
    return np.where(_shapes(found.assembly), np.minimum(spread, BASELINE_SHAPE * own), spread)


def _shapes(assembly: TorqueModel) -> NDArray[np.bool_]:
    """Parameters that the torque is not linear in (P,)."""
    shapes = {(p.effect.name, p.at, x.name) for p in assembly.placed for x in p.effect.parameters if x.grid}
    return np.array([(s.effect, s.at, s.name) in shapes for s in assembly.slots], bool)


def inertial_part(assembly: TorqueModel) -> Array:
    """The unit of every link's inertial parameters (10 L,): its mass, that times its reach, and times its square.

    The reach is the radius of gyration about the link's frame, √(trace(I) / m).
    """
    phi = assembly.phi.reshape(-1, 10)
    mass = np.abs(phi[:, 0])
    reach = np.sqrt(np.maximum(np.abs(phi[:, 4] + phi[:, 7] + phi[:, 9]) / np.maximum(mass, 1e-9), 1e-6))
    return np.stack([mass, *[mass * reach] * 3, *[mass * reach**2] * 6], axis=1).ravel()


def regressor_columns(e: Experiment, channel: int) -> Part:
    """Inertial parameters that a channel feels (k,), and its torque by them in the analysis band (n_band, k)."""
    at, columns = e.regressor.of(channel)
    return at, e.to_band(columns, channel)
