"""The torque columns that the rivals choose from: the textbook law of every effect, at every place of an arm.

Conditioning as in textbook identification (Gautier 1997): positions through a zero-phase low-pass, central differences,
the torque and every column through the same filter, then thinned to 25 Hz. The rigid body is the package's, which all
methods are given alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from snarelab.models.model import Model
from snarelab.models.model_file import load_model
from snarelab.models.rigid_body import RigidBody

CUTOFF = 8.0
"""Low-pass on positions and torque [Hz]; figures are compared below it."""
RATE = 25.0
"""To which filtered samples are thinned [Hz]."""
TRAVELS = (2e-4, 5e-4, 1e-3, 2e-3, 5e-3)
"""Travel over which a joint's known friction turns round [rad]: which, the baseline's fit chooses."""

Column = tuple[str, str, int]
"""Effect, place, variant."""


@dataclass(frozen=True, eq=False)
class Recording:
    """One recording, conditioned: motion at full rate, each (n, J); torque filtered, and one sample in ``stride``
    (m, J)."""

    time: NDArray
    q: NDArray
    qd: NDArray
    qdd: NDArray
    tau: NDArray
    rate: float
    stride: int
    model: Model
    body: RigidBody

    @cached_property
    def sign(self) -> NDArray:
        """Direction of motion (n, J), turning round over a milliradian: defined at rest too."""
        return np.stack([dahl(q, 1e-3) for q in self.q.T], axis=1)

    @cached_property
    def load(self) -> NDArray:
        """The model's rigid-body torque (n, J)."""
        return self.body.torque(self.q, self.qd, self.qdd)

    def band(self, values: NDArray) -> NDArray:
        """Filtered as the torque is, and thinned."""
        return low_pass(values, self.rate)[:: self.stride]


def read(folder: Path, name: str, *, predict: bool = False) -> Recording:
    """Read and condition a case's recording; ``predict``: it has no torque, and columns are wanted at every row."""
    model = load_model(folder / "arm.toml")
    with (folder / name).open() as file:
        heads = file.readline().strip().split(",")
        table = np.loadtxt(file, delimiter=",")
    values = dict(zip(heads, table.T, strict=True))
    time = values["time"]
    rate = (len(time) - 1) / (time[-1] - time[0])
    q = low_pass(np.stack([values[f"q.{j}"] for j in model.joints], axis=1), rate)
    qd = np.gradient(q, 1.0 / rate, axis=0)
    tau = np.zeros_like(q) if predict else np.stack([values[f"tau.{j}"] for j in model.joints], axis=1)
    qdd = np.gradient(qd, 1.0 / rate, axis=0)
    stride = 1 if predict else max(round(rate / RATE), 1)
    tau = low_pass(tau, rate)[::stride]
    return Recording(time - time[0], q, qd, qdd, tau, rate, stride, model, RigidBody(model.tree))


def low_pass(values: NDArray, rate: float) -> NDArray:
    """Values (n, ...) sampled at a rate [Hz], without what is faster than `CUTOFF`, and without lag."""
    return np.asarray(sosfiltfilt(butter(4, CUTOFF, fs=rate, output="sos"), values, axis=0))


def baseline(r: Recording, travels: Sequence[float]) -> NDArray:
    """Columns (m, J, k) of what the model has: friction at joints, inertial parameters where they are free.

    Presliding is the travel over which a joint's Coulomb friction turns round, one of ``travels`` a joint.
    """
    found = []
    for placed in r.model.effects:
        k = r.model.joints.index(placed.at)
        if placed.effect.name == "coulomb_friction":
            found.append(_one(r, k, dahl(r.q[:, k], travels[k])[:, None]))
        elif placed.effect.name != "presliding_hysteresis":
            found.append(_one(r, k, _joint_law(r, k, placed.effect.name)[0]))
    if r.model.inertia == "free":
        found.append(r.band(r.body.regressor(r.q, r.qd, r.qdd)))
    return np.concatenate(found, axis=2)


def fixed(r: Recording) -> NDArray:
    """Torque (m, J) that the model predicts without any parameter to fit."""
    return np.zeros_like(r.tau) if r.model.inertia == "free" else r.band(r.load)


def library(r: Recording, like: Recording | None = None) -> dict[Column, NDArray]:
    """Every effect that the model lacks, at every place, by (name, place, variant): columns (m, J, k).

    Grids refer to the travel and speed in ``like``, the recording that was fitted.
    """
    have, found = {p.key for p in r.model.effects}, {}
    for k, name in enumerate(r.model.joints):
        for effect in JOINT:
            if f"{effect}.{name}" not in have:
                for v, columns in enumerate(_joint_law(r, k, effect, like)):
                    found[effect, name, v] = _one(r, k, columns)
        channel = f"tau.{name}"
        load, time = r.load[:, [k]], r.time[:, None]
        slope = np.gradient(load, 1.0 / r.rate, axis=0)
        for effect, column in (
            ("sensor_bias", np.ones_like(load)),
            ("sensor_drift", time),
            ("sensor_gain", load + r.sign[:, [k]]),
            ("sensor_delay", -slope),
        ):
            found[effect, channel, 0] = _one(r, k, column)
        step = np.zeros_like(r.q)
        step[:, k] = 1e-4 * r.load[:, k]
        bent = r.q - step
        bent_speed = np.gradient(bent, 1.0 / r.rate, axis=0)
        moved = r.body.torque(bent, bent_speed, np.gradient(bent_speed, 1.0 / r.rate, axis=0)) - r.load
        found["joint_elasticity", name, 0] = r.band(moved[:, :, None])
        by_q, _ = r.body.tangent(r.q, r.qd, r.qdd)
        found["backlash", name, 0] = r.band(-(by_q[:, :, k] * np.tanh(r.load[:, [k]]))[:, :, None])
    if r.model.inertia == "fixed":
        regressor = r.body.regressor(r.q, r.qd, r.qdd)
        for i, link in enumerate(r.model.tree.links):
            own = regressor[:, :, 10 * i : 10 * i + 10]
            found["payload_mass", link.name, 0] = r.band(own[:, :, :4])
            found["com_offset", link.name, 0] = r.band(own[:, :, 1:4])
            found["inertia_error", link.name, 0] = r.band(own)
    return found


JOINT = (
    *("viscous_friction", "coulomb_friction", "asymmetric_friction", "stribeck_friction", "makkar_friction"),
    *("quadratic_friction", "load_dependent_friction", "position_dependent_friction", "presliding_hysteresis"),
    *("torque_ripple", "rotor_inertia", "harness_stiffness"),
)


def _joint_law(r: Recording, k: int, effect: str, like: Recording | None = None) -> list[NDArray]:
    """Columns (n, k) of a law at a joint, one entry a variant of its shape."""
    q, qd, qdd, load = r.q[:, k], r.qd[:, k], r.qdd[:, k], r.load[:, k]
    scale = like or r
    travel, speed = float(np.ptp(scale.q[:, k])), float(np.abs(scale.qd[:, k]).max())
    sign = r.sign[:, k]

    def stribeck(share: float) -> NDArray:
        return np.exp(-((qd / (share * speed)) ** 2)) * sign

    def wave(length: float) -> NDArray:
        angle = 2.0 * np.pi * q / length
        return np.stack([np.sin(angle), np.cos(angle)], axis=1)

    laws: dict[str, Callable[[], list[NDArray]]] = {
        "viscous_friction": lambda: [qd],
        "coulomb_friction": lambda: [sign],
        "asymmetric_friction": lambda: [np.ones_like(q)],
        "stribeck_friction": lambda: [stribeck(x) for x in (0.03, 0.1, 0.2)],
        "makkar_friction": lambda: [np.stack([stribeck(x), sign, qd], axis=1) for x in (0.05, 0.1, 0.2)],
        "quadratic_friction": lambda: [np.abs(qd) * qd],
        "load_dependent_friction": lambda: [np.abs(load) * sign],
        "position_dependent_friction": lambda: [
            wave(x * travel) * sign[:, None] for x in (0.2, 0.25, 0.32, 0.4, 0.5, 0.65, 0.8, 1.0)
        ],
        "presliding_hysteresis": lambda: [dahl(q, x * travel) - sign for x in (0.003, 0.01, 0.03)],
        "torque_ripple": lambda: [wave(travel / x) for x in np.arange(3.0, 20.1, 0.5)],
        "rotor_inertia": lambda: [qdd],
        "harness_stiffness": lambda: [np.stack([q, np.ones_like(q)], axis=1)],
    }
    return [x if x.ndim == 2 else x[:, None] for x in laws[effect]()]


def dahl(q: NDArray, travel: float) -> NDArray:
    """Bent share of bristles (n,) along a motion: exact over each step (Dahl 1968)."""
    bent = np.zeros(len(q))
    for k, step in enumerate(np.diff(q).tolist()):
        end = np.sign(step)
        bent[k + 1] = end + (bent[k] - end) * np.exp(-abs(step) / travel)
    return bent


def _one(r: Recording, k: int, columns: NDArray) -> NDArray:
    """Columns (n, c) of channel k, filtered, as columns of all channels (m, J, c)."""
    columns = r.band(columns)
    full = np.zeros((len(columns), len(r.model.joints), columns.shape[1]))
    full[:, k] = columns
    return full
