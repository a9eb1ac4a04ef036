"""Motor and link encoders as a source: the difference of the two encoders of a joint is a channel.

The shifts are the encoders' zeros, one for each recording and joint: encoders may be referenced anew, and a zero
explains no motion. How far they go is known to a share that the evidence chooses: a zero that every recording has is a
bias.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.effect import Parameter, written_unit
from ...models.effects import effects, get_effect
from ...models.hidden_state import reads
from ...models.model import Model, PlacedEffect
from ...recordings import JointKind
from ..arms.blocks import FEWEST_BLOCKS
from ..deciding import BLOCK, LEAST_LEVEL, SIZES
from ..fitting.assembly import TorqueModel
from ..fitting.experiment import Experiment, Scales
from ..nuisance.curve import Coordinates, family
from ..nuisance.noise import NoiseChannel
from ..nuisance.rest import SETTLES, STICKS, share
from ..sources.source import GridPoint, Linearisation, ModelPoint
from .run import EncoderPair

Array = NDArray[np.float64]


class Links:
    """The two encoders of some joints in recordings, those for training first.

    Parameters
    ----------
    joints : sequence of str
    kinds : sequence of JointKind
        Of each.
    scales : sequence of Scales
        Of each in the training recordings, which bounds and grids refer to.
    rows : sequence of sequences of EncoderPair
        Of recording i and joint c.
    n_train : int
    """

    anew, bent, steps = True, False, 12

    def __init__(
        self,
        joints: Sequence[str],
        kinds: Sequence[JointKind],
        scales: Sequence[Scales],
        rows: Sequence[Sequence[EncoderPair]],
        n_train: int,
    ) -> None:
        """Nothing is worked out yet."""
        self.joints, self.kinds, self.scales, self.rows = tuple(joints), tuple(kinds), tuple(scales), rows
        self.train, self.held = range(n_train), range(n_train, len(rows))
        self.channels = tuple(f"q_link.{j}" for j in joints)
        self.n_shifts = len(rows) * len(joints)
        self._measured = [np.stack([run.measured for run in row], axis=1) for row in rows]
        train = self._measured[:n_train]
        # A zero may be anything up to the largest reading.
        self._zero = np.maximum(np.max([np.sqrt(np.mean(x**2, axis=0)) for x in train], axis=0), 1e-12)
        about = np.concatenate([x - x.mean(axis=0) for x in train])
        self._scale = np.maximum(np.sqrt(np.mean(about**2, axis=0)), 1e-12)
        self._term = lru_cache(64 * self.n_shifts)(self._worked)
        self._curves: dict[tuple[int, str], list[Array]] = {}

    def channel(self, p: PlacedEffect) -> int:
        """The joint that an effect acts at, as a number."""
        return self.joints.index(p.at.removeprefix("q_link.").removeprefix("q."))

    def term(self, i: int, p: PlacedEffect, parameters: Array) -> tuple[Array, Array]:
        """What an effect adds to its channel in the analysis band (n,), and its slopes (n, p)."""
        return self._term(i, self.channel(p), p.effect.name, p.at, tuple(map(float, parameters)))

    def _worked(self, i: int, c: int, name: str, at: str, parameters: tuple[float, ...]) -> tuple[Array, Array]:
        run = self.rows[i][c]
        value, slopes = run.term(PlacedEffect(get_effect(name), at), np.array(parameters))
        whole = run.motion.to_band(np.concatenate([value[:, None], slopes], axis=1))
        return whole[:, 0], whole[:, 1:]

    def zeros(self, at: ModelPoint) -> Array:
        """Zeros of every recording and channel (recordings, c) [rad or m]."""
        return at.shifts.reshape(len(self.rows), -1) * self._zero

    def measured(self, i: int) -> Array:
        return self._measured[i]

    def predicted(self, i: int, at: ModelPoint) -> Array:
        found = np.tile(self.zeros(at)[i], (len(self._measured[i]), 1))
        for p in at.placed:
            found[:, self.channel(p)] += self.term(i, p, at.of_effect(p))[0]
        return found

    def refused(self, i: int) -> InputError:
        return InputError(f"{self.rows[i][0].motion.path}: the encoders cannot be predicted")

    def slopes(self, i: int, at: ModelPoint, here: Array) -> Array:
        found, k = np.zeros((*here.shape, len(at.values))), 0
        for p in at.placed:
            free = [n for n, x in enumerate(p.effect.parameters) if x.name not in p.hold]
            found[:, self.channel(p), k : k + len(free)] = self.term(i, p, at.of_effect(p))[1][:, free]
            k += len(free)
        return found

    def own_shifts(self, p: PlacedEffect) -> tuple[int, ...]:
        return ()

    def shift_slopes(self, i: int, at: ModelPoint, here: Array) -> Array:
        found = np.zeros((*here.shape, len(self.rows), len(self.joints)))
        for c, size in enumerate(self._zero):
            found[:, c, i, c] = size
        return found.reshape(*here.shape, -1)

    def settled(self, at: ModelPoint, numbers: Sequence[int]) -> ModelPoint:
        """With the zeros of some recordings as they are there; what all training recordings share is a bias's."""
        zeros, values = at.shifts.reshape(len(self.rows), -1).copy(), at.values.copy()
        for i in numbers:
            zeros[i] += np.mean(self._measured[i] - self.predicted(i, at), axis=0) / self._zero
        for k, (p, _) in enumerate(at.free):
            if self.still(p) and set(self.train) <= set(numbers):
                c = self.channel(p)
                shared = float(np.mean(zeros[list(self.train), c]))
                values[k] += shared * self._zero[c]
                zeros[list(numbers), c] -= shared
        return ModelPoint(at.placed, at.fixed, values, zeros.ravel())

    def scale(self) -> Array:
        return self._scale

    def bounds(self, p: PlacedEffect, x: Parameter) -> tuple[float, float]:
        scale = self.scales[self.channel(p)].of(x.relative_to)
        return x.low * scale, x.high * scale

    def size(self, p: PlacedEffect, x: Parameter) -> float:
        if x.grid:
            return min(abs(g) for g in x.grid) * self.scales[self.channel(p)].of(x.relative_to)
        k = p.effect.parameters.index(x)
        own = [self.term(i, p, np.array([y.zero for y in p.effect.parameters]))[1][:, k] for i in self.train]
        return float(self._scale[self.channel(p)] / np.sqrt(np.mean(np.concatenate(own) ** 2) + 1e-300))

    def unit(self, p: PlacedEffect, x: Parameter) -> str:
        return written_unit(x.unit, self.kinds[self.channel(p)], "q_link.")

    def library(self, placed: Sequence[PlacedEffect]) -> list[PlacedEffect]:
        """Sensors' faults of the link's encoder, of the motor's where time tells the two apart; twists of the drive.

        A fault that either encoder may have is listed for one of them: for the other it is an alias."""
        have = {(p.effect.name, self.channel(p)) for p in placed}
        found = []
        for c, joint in enumerate(self.joints):
            for effect in effects().values():
                at = [joint] if effect.at == "joint" and effect.acts_on == "position" else []
                if effect.at == "sensor" and not effect.leads and {"value", "time"}.issuperset(reads(effect)):
                    at = [f"q.{joint}", f"q_link.{joint}"] if effect.states else [f"q_link.{joint}"]
                found += [PlacedEffect(effect, x) for x in at if (effect.name, c) not in have]
        return found

    def still(self, p: PlacedEffect) -> bool:
        """Whether an effect is constant in time."""
        return not p.effect.states and all(np.ptp(self.term(i, p, np.ones(1))[0]) < 1e-9 for i in self.train)

    def variants(self, p: PlacedEffect) -> list[GridPoint]:
        """A parameter without a grid is an amplitude."""
        scale = self.scales[self.channel(p)]
        shapes = [x for x in p.effect.parameters if x.grid]
        amplitudes = tuple(f"{p.key}.{x.name}" for x in p.effect.parameters if not x.grid)
        # As large as a zero may be, at the largest of the sizes that are averaged over.
        size = self._zero[self.channel(p)] / SIZES[-1] if amplitudes and self.still(p) else 0.0
        axes = [[g * scale.of(x.relative_to) for g in x.grid] for x in shapes]
        return [
            GridPoint(p, {f"{p.key}.{x.name}": v for x, v in zip(shapes, point, strict=True)}, amplitudes, float(size))
            for point in product(*axes)
        ]

    def columns(self, i: int, at: ModelPoint, many: Sequence[GridPoint]) -> list[Array]:
        return [self._column(i, v) for v in many]

    def _column(self, i: int, v: GridPoint) -> Array:
        names = [f"{v.placed.key}.{x.name}" for x in v.placed.effect.parameters]
        value, slopes = self.term(i, v.placed, np.array([v.values.get(k, 0.0) for k in names]))
        own = slopes[:, [names.index(k) for k in v.amplitudes]] if v.amplitudes else value[:, None]
        found = np.zeros((len(value), len(self.joints), own.shape[1]))
        found[:, self.channel(v.placed)] = own
        return found

    def curves(self, numbers: Sequence[int]) -> Mapping[tuple[int, str], list[Array]]:
        if not self._curves:
            for c in range(len(self.joints)):
                runs = [row[c] for row in self.rows]
                peak, travel = self._moves(c)
                signals = [Coordinates.along(r.motion, r.load, r.joint, peak, travel) for r in runs]
                for curve in family(runs[0].joint, runs[0].motion.joints, signals[: len(self.train)], True):
                    own = [r.motion.to_band(curve.columns(x)) for r, x in zip(runs, signals, strict=True)]
                    self._curves[c, curve.words] = own
        return {k: [x[i] for i in numbers] for k, x in self._curves.items()}

    def _moves(self, c: int) -> tuple[float, float]:
        """Peak speed and travel of a joint in the training recordings."""
        motions = [self.rows[i][c].motion for i in self.train]
        j = self.rows[0][c].joint
        speed, travel = (max(float(np.max(f(m))) for m in motions) for f in (
            lambda m: np.abs(m.qd[:, j]), lambda m: np.ptp(m.q[:, j])))  # fmt: skip
        return max(speed, 1e-12), max(travel, 1e-12)

    def noise_channels(
        self, numbers: Sequence[int], linear: Linearisation, could: Sequence[Sequence[Array]]
    ) -> list[list[NoiseChannel]]:
        """Where a joint stands, friction holds its drive wound up by what no load tells, and encoders hold their steps:
        what nothing explains there, in the RMS, and `LEAST_LEVEL` of the channel at least."""
        found: list[list[NoiseChannel]] = [[] for _ in numbers]
        for c in range(len(self.joints)):
            peak, travel = self._moves(c)
            motions, j = [self.rows[i][c].motion for i in numbers], self.rows[0][c].joint
            along = np.eye(motions[0].qd.shape[1])[j]
            shares = [[share(m, along, zone, peak, travel) for zone in (*STICKS, SETTLES)] for m in motions]
            rest = [x[0] > 0.5 for x in shares]
            left = np.concatenate([r[k, c] for r, k in zip(linear.residuals, rest, strict=True)])
            beside = np.concatenate([x[k] for x, k in zip(could[c], rest, strict=True)])
            level = LEAST_LEVEL * self._scale[c]
            if len(left) > 2 * beside.shape[1]:
                left = left - beside @ np.linalg.lstsq(beside, left, rcond=1e-6)[0]
                level = max(level, float(np.sqrt(left @ left / (len(left) - beside.shape[1]))))
            for own, m, x in zip(found, motions, shares, strict=True):
                step, n = m.period * m.thinning, len(x[0])
                own.append(NoiseChannel(step, m.band_segments(), np.zeros(n), tuple(x[:-1]), x[-1], level))
        return found

    def blocks(self, i: int, x: Array) -> Array:
        count = int(len(x) / (2 * self.rows[i][0].motion.band) / BLOCK)
        return np.array([part.sum() for part in np.array_split(x, max(count, FEWEST_BLOCKS))])


def links_of(
    joints: Sequence[str],
    model: Model,
    train: Sequence[Experiment],
    held: Sequence[Experiment],
    assembly: TorqueModel,
    theta: Array,
    scales: Mapping[str, Scales],
) -> Links:
    """Some joints' encoders, loaded by the rigid-body torque of a model at its parameters ``theta``."""
    at, rows = [model.joints.index(j) for j in joints], []
    for e in (*train, *held):
        load = assembly.evaluate(e, theta).load
        rows.append([EncoderPair(e.motion, n, load[:, n], e.mass_matrix[:, n, n]) for n in at])
    kinds: list[JointKind] = [model.tree.joints[n].kind for n in at]
    return Links(joints, kinds, [scales[j] for j in joints], rows, len(train))


def start(links: Links, model: Model) -> ModelPoint:
    """What a model has between the encoders; a parameter without a value starts at a usual one."""
    able = {p.key for p in links.library(())}
    placed = [p for p in model.effects if p.key in able]
    values = {}
    for p in placed:
        scale = links.scales[links.channel(p)]
        for x in p.effect.parameters:
            values[f"{p.key}.{x.name}"] = model.values.get(f"{p.key}.{x.name}", x.zero * scale.of(x.relative_to))
    return ModelPoint.of(placed, values, links.n_shifts)
