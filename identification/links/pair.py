"""A second, link-side encoder: how it differs from the motor's, modelled along the recorded motion.

What the two encoders of a joint differ by, channel ``q_link.<joint>`` less ``q.<joint>``, is a measurement of its own,
far finer than either position::

    q_link - q = zero of the recording - twist(load) + late(q) - q + error * q + rate * time

with the twist of an elastic drive or of play in the gear under the modelled rigid-body torque (never the measured one,
which carries friction), and the sensors' laws from the vocabulary. Terms of second order, such as a twist that is read
late, are left out. Each recording has a zero of its own: encoders are referenced anew, and a zero explains no motion.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...models.effect import Parameter, written_unit
from ...models.floating.tree import FloatingTree
from ...models.hidden_state import evaluate_law
from ...models.model import Model, Placed
from ...models.rigid_body import RigidBody
from ...recordings import JointKind
from ...recordings.condition import Motion, condition
from ..fitting.assembly import Assembly
from ..fitting.experiment import Experiment, Scales
from ..fitting.fit import CLUSTER
from ..fitting.least_squares import Normal, Objective, minimise
from ..fitting.recorded import read_motion
from ..search.noise import Whitener

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Run:
    """One joint in one recording: ``motion.tau`` holds link less motor position, ``load`` (n,) [N·m or N] the modelled
    rigid-body torque, ``inertia`` (n,) the joint's own entry of the mass matrix."""

    motion: Motion
    joint: int
    load: Array
    inertia: Array

    @cached_property
    def measured(self) -> Array:
        """Link less motor position in the analysis band (n_band,)."""
        return self.motion.to_band(self.motion.tau[:, self.joint])

    def term(self, placed: Placed, parameters: Array) -> tuple[Array, Array]:
        """What an effect adds to the difference (n,), and its derivative by the effect's parameters (n, p)."""
        motion, j, effect = self.motion, self.joint, placed.effect
        q = motion.q[:, j]
        signals = {
            "q": q,
            "qd": motion.qd[:, j],
            "qdd": motion.qdd[:, j],
            "load": self.load,
            "inertia": self.inertia,
            "value": q,
            "time": motion.time - motion.time[0],
            "temperature": motion.temperature[:, j],
            "speed_scale": np.full(len(q), np.max(np.abs(motion.qd[:, j]))),
        }
        # A late motor encoder makes the link's early against it: time runs backwards.
        direction = slice(None, None, -1) if placed.at.startswith("q.") else slice(None)
        parts = []
        for segment in motion.segments:
            inputs = {name: x[segment][direction] for name, x in signals.items()}
            values, by_parameter, _ = evaluate_law(effect, inputs, parameters, motion.period)
            parts.append((values[direction, 0], by_parameter[direction, 0]))
        values, by_parameter = (np.concatenate(x) for x in zip(*parts, strict=True))
        return (values - q if effect.at == "sensor" else values), by_parameter


@dataclass(frozen=True)
class Pair:
    """The two encoders of one joint in several recordings.

    ``scales`` are the joint's in the training recordings, which bounds and grids refer to.
    """

    joint: str
    kind: JointKind
    scales: Scales
    runs: tuple[Run, ...]

    def bounds(self, p: Parameter) -> tuple[float, float]:
        """Physical bounds of an effect's parameter."""
        scale = self.scales.of(p.relative_to)
        return p.low * scale, p.high * scale

    def unit(self, p: Parameter) -> str:
        """A parameter's unit with the joint's torque and position units written out."""
        return written_unit(p.unit, self.kind, "q_link.")

    @property
    def segments(self) -> tuple[slice, ...]:
        """Runs without a gap, in the analysis band, all recordings end to end."""
        found, start = [], 0
        for run in self.runs:
            found += [slice(s.start + start, s.stop + start) for s in run.motion.band_segments()]
            start += len(run.measured)
        return tuple(found)

    def linearised(self, placed: Sequence[Placed], theta: Array) -> tuple[Array, Array]:
        """Residual (n_band,) and derivative of the model (n_band, P), all recordings end to end.

        ``theta`` holds the effects' parameters in order, then one zero for each recording.
        """
        residuals, columns = [], []
        count = sum(len(p.effect.parameters) for p in placed)
        for number, run in enumerate(self.runs):
            value, own, at = np.full(len(run.motion.time), theta[count + number]), [], 0
            for p in placed:
                size = len(p.effect.parameters)
                term, by_parameter = run.term(p, theta[at : at + size])
                value, at = value + term, at + size
                own.append(by_parameter)
            zeros = np.zeros((len(value), len(self.runs)))
            zeros[:, number] = 1.0
            columns.append(run.motion.to_band(np.concatenate([*own, zeros], axis=1)))
            residuals.append(run.measured - run.motion.to_band(value))
        return np.concatenate(residuals), np.concatenate(columns)


@dataclass(frozen=True)
class PairFit:
    """A fit of a pair's difference: parameters and zeros (P,), residual (n,) and derivative (n, P), whitened or in the
    joint's unit."""

    placed: tuple[Placed, ...]
    theta: Array
    residual: Array
    jacobian: Array

    @property
    def energy(self) -> float:
        """Squared residual."""
        return float(self.residual @ self.residual)

    def parameters(self, placed: Placed) -> slice:
        """Where an effect's parameters stand in theta."""
        start = 0
        for p in self.placed:
            stop = start + len(p.effect.parameters)
            if p.key == placed.key:
                return slice(start, stop)
            start = stop
        raise KeyError(placed.key)

    @property
    def zeros(self) -> Array:
        """Zero of each recording [rad or m]."""
        return self.theta[sum(len(p.effect.parameters) for p in self.placed) :]


def fit_pair(pair: Pair, placed: Sequence[Placed], start: Array, whiten: Whitener | None = None) -> PairFit:
    """Least squares over all parameters and zeros, in the analysis band or on whitened samples.

    Parameters
    ----------
    pair : Pair
    placed : sequence of Placed
    start : array (P,)
        Effects' parameters in order, then a zero for each recording.
    whiten : Whitener, optional
    """
    segments = pair.segments
    low, high = (np.full(len(start), sign * np.inf) for sign in (-1, 1))
    at = 0
    for p in placed:
        for x in p.effect.parameters:
            low[at], high[at] = (start[at],) * 2 if x.name in p.hold else pair.bounds(x)
            at += 1

    def white(theta: Array) -> tuple[Array, Array]:
        residual, jacobian = pair.linearised(placed, theta)
        return (residual, jacobian) if whiten is None else (whiten(residual, segments), whiten(jacobian, segments))

    def normal(theta: Array) -> Normal:
        residual, jacobian = white(theta)
        cost = 0.5 * float(residual @ residual)
        return Normal(cost if np.isfinite(cost) else np.inf, -jacobian.T @ residual, jacobian.T @ jacobian)

    theta = minimise(Objective(normal, low, high), np.clip(start, low, high)).theta
    return PairFit(tuple(placed), theta, *white(theta))


def deviations(pair: Pair, found: PairFit) -> Array:
    """Standard deviation of a plain fit's parameters (P,), robust to what half-second clusters share; inf where the
    recordings say nothing."""
    length = max(1, round(CLUSTER * 2 * pair.runs[0].motion.band))
    score = found.jacobian * found.residual[:, None]
    sums = [score[a : min(a + length, s.stop)].sum(0) for s in pair.segments for a in range(s.start, s.stop, length)]
    scale = np.sqrt(np.sum(found.jacobian**2, axis=0))
    known = scale > 0
    inverse = np.zeros((len(scale), len(scale)))
    unit = found.jacobian[:, known] / scale[known]
    inverse[np.ix_(known, known)] = np.linalg.pinv(unit.T @ unit, hermitian=True) / np.outer(scale[known], scale[known])
    covariance = inverse @ (np.array(sums).T @ np.array(sums)) @ inverse
    return np.where(known, np.sqrt(np.diag(covariance)), np.inf)


def load_links(
    model: Model, recordings: Sequence[str | Path], body: RigidBody, band: float
) -> tuple[tuple[str, ...], list[Experiment]]:
    """Joints that have a link-side encoder in every recording, and the recordings with link less motor position in
    place of torque.

    Parameters
    ----------
    model : Model
    recordings : sequence of path
    body : RigidBody
    band : float
        Edge of the analysis band [Hz].

    Raises
    ------
    InputError
        Whatever is wrong with a recording.
    """
    if isinstance(model.tree, FloatingTree):
        return (), []
    datasets = [read_motion(model, path) for path in recordings]
    # A column that never changes while the joint moves is no encoder.
    joints = tuple(
        j
        for j in model.joints
        if all(f"q_link.{j}" in d and d[f"q_link.{j}"].max() > d[f"q_link.{j}"].min() for d in datasets)
    )
    if not joints:
        return (), []
    made = []
    for d in datasets:
        zero = d[f"q.{model.joints[0]}"] * 0.0
        difference = {f"tau.{j}": d[f"q_link.{j}"] - d[f"q.{j}"] if j in joints else zero for j in model.joints}
        made.append(Experiment(condition(d.assign(difference), model.joints, band), body))
    return joints, made


def pair_of(
    joint: str, model: Model, links: Sequence[Experiment], assembly: Assembly, theta: Array, scales: Scales
) -> Pair:
    """One joint's encoders, loaded by the rigid-body torque of a model at its parameters ``theta``."""
    number = model.joints.index(joint)
    runs = [
        Run(e.motion, number, assembly.evaluate(e, theta).load[:, number], e.mass_matrix[:, number, number])
        for e in links
    ]
    return Pair(joint, model.tree.joints[number].kind, scales, tuple(runs))


def held_out(pair: Pair, locked: Pair, found: PairFit) -> PairFit:
    """A fit's parameters on other recordings; of those, only the zeros are taken from the recordings themselves."""
    count = len(found.theta) - len(pair.runs)
    theta = np.concatenate([found.theta[:count], np.zeros(len(locked.runs))])
    placed = tuple(replace(p, hold=tuple(x.name for x in p.effect.parameters)) for p in found.placed)
    return fit_pair(locked, placed, theta)
