"""A conditioned recording with the rigid body's terms, computed once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import InputError
from ...models.axes import place
from ...models.floating.tree import FloatingTree, channel
from ...models.model import Model
from ...models.regressor import Regressor
from ...models.rigid_body import RigidBody
from ...recordings.condition import Motion, condition
from .floating_terms import as_carriers, twist_noise, wheel_impulse, with_base, with_twist
from .recorded import read_all, read_motion

Array = NDArray[np.float64]

NOTHING, FLOOR = 1e-10, 1e-6
"""Share of the largest torque up to which a channel reads nothing; and of its floor of noise."""


@dataclass(frozen=True, eq=False)
class Bridge:
    """Straight lines across runs of samples: the samples ``at`` (k,) lie the share ``part`` of the way from the samples
    ``before`` to the samples ``after``.

    A bridge is linear, and equal for measured torque, modelled torque and every column, so that their differences
    remain exact.
    """

    at: NDArray[np.int_]
    before: NDArray[np.int_]
    after: NDArray[np.int_]
    part: Array

    def __call__(self, x: Array) -> Array:
        """Samples (n, ...) with the runs bridged."""
        y, part = np.array(x, order="F"), self.part.reshape(-1, *(1,) * (x.ndim - 1))
        y[self.at] = (1 - part) * x[self.before] + part * x[self.after]
        return y


@dataclass(frozen=True, eq=False)
class Experiment:
    """Motion of one recording and the rigid body's share of its torque.

    ``n`` samples, ``J`` joints, ``L`` links; ``tension`` has the measured tension of each of a rig's slings (n,) [N].
    ``impulse`` (n, 3) is the commanded angular impulse of reaction wheels on a floating base up to each sample, in its
    axes [N·m·s]. ``store`` keeps columns that do not change while a model is fitted.
    """

    motion: Motion
    body: RigidBody
    tension: Mapping[str, Array] = field(default_factory=dict)
    impulse: Array | None = None
    store: dict[object, Any] = field(default_factory=dict, repr=False)
    bridged: tuple[Bridge, ...] = ()
    """For each channel, runs of samples that are no data; none by default."""
    kept: NDArray[np.bool_] | None = None
    """Samples of the analysis band that count (n_band, J); the others are zero. All by default."""
    whole: "Experiment | None" = field(default=None, repr=False)
    """This recording without bridges, along the same motion: what the rigid body gives is worked out there."""

    def to_band(self, x: Array, channel: int) -> Array:
        """Samples (n, ...) of a channel, bridged where they are no data, in the analysis band (n_band, ...)."""
        banded = self.motion.to_band(self.bridged[channel](x) if self.bridged else x)
        return banded if self.kept is None else banded * self.kept[:, channel].reshape(-1, *(1,) * (x.ndim - 1))

    def all_to_band(self, x: Array) -> Array:
        """Samples of all channels (n, J), bridged where they are no data, in the analysis band (n_band, J)."""
        if self.bridged:
            x = np.stack([b(own) for b, own in zip(self.bridged, x.T, strict=True)], 1)
        banded = self.motion.to_band(x)
        return banded if self.kept is None else banded * self.kept

    @property
    def counted(self) -> Array:
        """Number of samples of each channel that count in the analysis band (J,)."""
        return np.full(self.measured.shape[1], len(self.measured)) if self.kept is None else self.kept.sum(axis=0)

    def with_bridges(self, bridges: tuple[Bridge, ...], kept: NDArray[np.bool_] | None) -> "Experiment":
        """This recording with runs of samples that are no data. The rigid body's results are kept."""
        return replace(self, store={}, bridged=bridges, kept=kept, whole=self.whole or self)

    @cached_property
    def regressor(self) -> Regressor:
        """Torque per inertial parameter."""
        m = self.motion
        return self.whole.regressor if self.whole else self.body.packed_regressor(m.q, m.qd, m.qdd)

    @cached_property
    def mass_matrix(self) -> Array:
        """Joint-space inertia at the nominal parameters (n, J, J)."""
        return self.whole.mass_matrix if self.whole else self.body.mass_matrix(self.motion.q)

    @cached_property
    def tangent(self) -> tuple[Array, Array]:
        """Derivative of the nominal torque by position and by rate, each (n, J, J); slings move with the arm."""
        if self.whole:
            return self.whole.tangent
        gravity = np.zeros(3) if self.body.tree.balanced else None
        return self.body.tangent(self.motion.q, self.motion.qd, self.motion.qdd, gravity=gravity)

    @cached_property
    def carried(self) -> Array:
        """Torque that is not supplied by the drives (n, J) [N·m or N]: of a rig's slings, of a base's momentum."""
        own, q = self.body, self.motion.q
        return self.whole.carried if self.whole else own.tree.carried(own, q, lambda: self.regressor, self.tension)

    @cached_property
    def modelled(self) -> Array:
        """Torque of the rigid body as the model has it, without any effect (n, J) [N·m or N]."""
        return self.body.torque(self.motion.q, self.motion.qd, self.motion.qdd) - self.carried

    @cached_property
    def measured(self) -> Array:
        """Measured torque in the analysis band (n_band, J)."""
        return self.all_to_band(self.motion.tau)

    @cached_property
    def elapsed(self) -> Array:
        """Time from the recording's start (n,) [s]."""
        return self.motion.time - self.motion.time[0]


@dataclass(frozen=True)
class Scales:
    """Peak speed, travel and peak torque of a joint in the training recordings, and the middle of its travel; bounds
    and grids refer to them."""

    speed: float
    travel: float
    torque: float
    middle: float = 0.0

    def of(self, kind: str) -> float:
        """The scale that a parameter's ``relative_to`` names."""
        return {
            "": 1.0,
            "speed": self.speed,
            "travel": self.travel,
            "place": self.travel,
            "torque": self.torque,
            "rate": self.torque / self.travel,
            "per_torque": 1 / self.torque,
        }[kind]

    def origin(self, kind: str) -> float:
        """Where numbers in this scale are counted from: places from the middle of the travel, all others from zero."""
        return self.middle if kind == "place" else 0.0


def load_experiments(
    model: Model,
    paths: Sequence[str | Path],
    body: RigidBody,
    band: float | None = None,
    *,
    torque: bool = True,
    datasets: Sequence[xr.Dataset] = (),
) -> list[Experiment]:
    """Read and condition recordings for a model; all in one analysis band, the narrowest that any of them carries.

    With different sample rates the bands differ a little: each recording is thinned by a whole number of samples.

    Parameters
    ----------
    model : Model
    paths : sequence of path
    body : RigidBody
    band : float, optional
        Edge of the analysis band [Hz].
    torque : bool
        Whether recorded torque counts; a motion needs none.
    datasets : sequence of xarray.Dataset
        The recordings, where they were read before; none: they are read here.

    Raises
    ------
    InputError
        None is given, or whatever is wrong with one.
    """
    if not paths:
        raise InputError("recordings: none is given; give one or more")
    if torque:
        datasets = datasets or read_all(model, paths)
    else:
        datasets = [without_torque(read_motion(model, path), model) for path in paths]
    measured = [_tensions(d, model) for d in datasets]
    tree = model.tree
    base = cast(FloatingTree, tree) if tree.carriers else None
    if base is not None:
        datasets = [with_twist(with_base(d, base), base) for d in datasets]
    datasets = [_without_gaps_in(t, d) for t, d in zip(measured, datasets, strict=True)]
    wanted = band or model.bandwidth
    motions = [condition(d, model.joints, wanted, fitted=torque) for d in datasets]
    free = tuple(
        c for c, j in enumerate(model.joints) if f"tau.{j}" in model.signals and model.signals[f"tau.{j}"].nothing
    )
    narrowest = min(m.band for m in motions)
    if any(m.band > 1.01 * narrowest for m in motions):
        motions = [condition(d, model.joints, narrowest, fitted=torque) for d in datasets]
    if base is not None:
        return [
            _balanced(
                Experiment(
                    as_carriers(m), body, impulse=wheel_impulse(d, m), store={"twist_noise": twist_noise(d, base)}
                )
            )
            for m, d in zip(motions, datasets, strict=True)
        ]
    return [
        Experiment(
            replace(m, undriven=free), body, {name: np.interp(m.time, d["time"].values, x) for name, x in t.items()}
        )
        for m, d, t in zip(motions, datasets, measured, strict=True)
    ]


def without_torque(dataset: xr.Dataset, model: Model) -> xr.Dataset:
    """The recording with ones for every joint's torque: it then decides on nothing."""
    return dataset.assign({f"tau.{j}": ("time", np.ones(dataset.sizes["time"])) for j in model.joints})


def _balanced(experiment: Experiment) -> Experiment:
    """With what the floating base's own momentum asks for on the measured side."""
    motion = experiment.motion
    return replace(experiment, motion=replace(motion, tau=motion.tau - experiment.carried))


def _tensions(dataset: xr.Dataset, model: Model) -> dict[str, Array]:
    """Recorded tension of the model's slings, by the sling's name, each (all rows,) [N]."""
    names = [name for name in model.tree.tensions if f"tension.{name}" in dataset]
    return {name: np.asarray(dataset[f"tension.{name}"].values, float) for name in names}


def _without_gaps_in(tensions: Mapping[str, Array], dataset: xr.Dataset) -> xr.Dataset:
    """The recording with positions missing wherever a tension is: conditioning then leaves the sample out."""
    if not tensions:
        return dataset
    good = np.isfinite(list(tensions.values())).all(axis=0)
    names = [name for name in dataset.data_vars if str(name).startswith("q.")]
    return dataset.assign({name: dataset[name].where(xr.DataArray(good, dims="time")) for name in names})


def with_silence(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Recordings in which channels that read zero throughout have a floor of noise, a millionth of the largest torque.

    Such a channel has no statistics: a force on a base that floats in a plane, the torque of an axis that no weight
    turns. It counts among `Motion.silent`, and a note says so.

    Raises
    ------
    InputError
        Where a joint's torque reads zero that by the model it cannot be: it was not recorded.
    """
    made = []
    for e in experiments:
        peak = np.max(np.abs(e.motion.tau), axis=0)
        known = np.isin(np.arange(len(peak)), e.motion.undriven)
        silent = np.flatnonzero((peak <= NOTHING * np.max(peak)) & ~known)
        if len(silent):
            modelled = np.max(np.abs(e.body.torque(e.motion.q, e.motion.qd, e.motion.qdd) - e.carried), axis=0)
            for c in silent[silent >= e.body.tree.carriers]:
                if not peak.any() or modelled[c] > FLOOR * np.max(peak):
                    raise InputError(
                        f"{e.motion.path}: 'tau.{e.motion.joints[c]}' is zero in every row; record the torque, or map "
                        "its column under [signals] in the model file"
                    )
            tau = e.motion.tau.copy("F")
            tau[:, silent] += FLOOR * np.max(peak) * np.random.default_rng(0).normal(size=(len(tau), len(silent)))
            names = ", ".join(channel(e.body.tree, int(c)) for c in silent)
            notes = (*e.motion.notes, f"{names}: zero in every row, as the model has it; nothing is judged there")
            e = replace(e, motion=replace(e.motion, tau=tau, silent=tuple(map(int, silent)), notes=notes))
        made.append(e)
    return made


def scales(experiments: Sequence[Experiment]) -> Mapping[str, Scales]:
    """Peak speed, travel and peak torque of every joint and axis over all recordings; never zero.

    For a joint that nothing drives, the rigid body's peak torque replaces the measured one."""
    found = {}
    undriven = experiments[0].motion.undriven
    modelled = [e.modelled for e in experiments] if undriven else []
    for k, joint in enumerate(experiments[0].motion.joints):
        q, qd, tau = (np.concatenate([getattr(e.motion, s)[:, k] for e in experiments]) for s in ("q", "qd", "tau"))
        if k in undriven:
            tau = np.concatenate([m[:, k] for m in modelled])
        found[joint] = Scales(
            max(float(np.max(np.abs(qd))), 1e-9),
            max(float(np.ptp(q)), 1e-9),
            max(float(np.max(np.abs(tau))), 1e-9),
            _middle(q),
        )
    for axis in experiments[0].body.tree.axes:
        here = place(experiments[0].body.tree, axis.name)
        motions = [e.motion for e in experiments]
        ends = [(here.coordinate(m.qd), here.coordinate(m.q), here.load(m.tau)) for m in motions]
        qd, q, tau = (np.concatenate(x) for x in zip(*ends, strict=True))
        speed, travel, torque = (max(float(x), 1e-9) for x in (np.abs(qd).max(), np.ptp(q), np.abs(tau).max()))
        found[axis.name] = Scales(speed, travel, torque, _middle(q))
    return found


def _middle(q: Array) -> float:
    return 0.5 * float(np.min(q) + np.max(q))
