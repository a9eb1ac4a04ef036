"""A floating base in a recording: its twist in its own axes, what that says of its momentum, and what effects read.

The base's six channels are force and moment on it, in its own axes about its frame's origin. Nothing drives a base
that floats, so that what the channel "measures" is what the base's own momentum rate asks for, with the sign turned
(plus a recorded force on it), and what is modelled is the arm's share. Their difference is the momentum balance of the
whole system, and the error is relative to the base's own momentum rate.

A recorded ``force.<base>.x``, ``torque.<base>.x`` acts from outside. ``torque.wheels.x`` is what reaction wheels were
told to give the base: it acts too, but the wheels keep its impulse, whose direction turns with the base.

Noise of these channels is that of a derivative: next to none at low frequency, where a small steady torque adds up in
the twist for as long as a recording lasts. 0.1 N·m on 100 kg·m² is 0.06 rad/s after a minute, and gyroscopes read that
to a millionth: scores of 1e8 and more are what such recordings are worth, and stay below what the twist's own white
noise would allow.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...models.floating.tree import CARRIERS, UNNAMED, FloatingTree
from ...recordings.attitude import attitude
from ...recordings.condition import Motion
from ...recordings.signals import QUATERNION

if TYPE_CHECKING:
    from .experiment import Experiment

Array = NDArray[np.float64]


def with_base(dataset: xr.Dataset, tree: FloatingTree) -> xr.Dataset:
    """The recording with the base's signals under the model's name for it.

    Where the model does not name the base, that is the body called as its link in the URDF, or the only body whose
    attitude and twist are recorded; the notes say which.
    """
    known = [str(name).split(".")[1] for name in dataset if str(name).startswith("quat.")]
    whole = {b for b in known if all(f"{kind}.{b}.{a}" in dataset for kind, axes in _NEEDED for a in axes)}
    if tree.body != UNNAMED or UNNAMED in known or not whole:
        return dataset
    link = tree.links[CARRIERS - 1].name
    if link not in whole and len(whole) > 1:
        return dataset
    body = link if link in whole else whole.pop()
    kinds = ("pos", "force", "torque", *(kind for kind, _ in _NEEDED))
    names = {f"{kind}.{body}.{a}": f"{kind}.{UNNAMED}.{a}" for kind in kinds for a in "wxyz"}
    renamed = dataset.rename({old: new for old, new in names.items() if old in dataset})
    note = f"the base is taken to be {body!r}; give 'base' in the model file to say so"
    return renamed.assign_attrs(notes=[*dataset.attrs.get("notes", ()), note])


def with_twist(dataset: xr.Dataset, tree: FloatingTree) -> xr.Dataset:
    """The recording with the base's twist in its own axes, and the force on it, under the names of its carriers.

    The twist stands where positions do, so that conditioning smooths it and takes its rate; `as_carriers` puts it in
    its place.

    Raises
    ------
    InputError
        Where the base's velocity, angular velocity or attitude is not recorded, or a quaternion's length is not 1.
    """
    path, body = dataset.attrs.get("path", "recording"), tree.body
    sets = {kind: [f"{kind}.{body}.{a}" for a in axes] for kind, axes in _NEEDED}
    for name in [name for names in sets.values() for name in names]:
        if name not in dataset:
            raise InputError(
                f"{path}: no signal {name!r} of the floating base; needed are vel, omega (world frame) and quat of "
                f"it: add the column, map it under [signals], or name the body by 'base' in the model file"
            )
    velocity, spin = (
        np.stack([np.asarray(dataset[name].values, float) for name in sets[k]], 1) for k in ("vel", "omega")
    )
    turns = attitude(dataset, body, path)
    good = np.asarray(np.isfinite(turns).all(1))
    back = Rotation.from_quat(np.where(good[:, None], turns, [1.0, 0, 0, 0]), scalar_first=True).inv()
    twist = np.hstack([back.apply(velocity), back.apply(spin)])
    twist[~good] = np.nan
    wrench, wheels = outside(dataset, tree), told(dataset)
    wrench[:, 3:] += wheels + np.cross(twist[:, 3:], _impulse(dataset, wheels))
    columns = {}
    for c, joint in enumerate(tree.joints[:CARRIERS]):
        columns |= {f"q.{joint.name}": ("time", twist[:, c]), f"tau.{joint.name}": ("time", wrench[:, c])}
    return dataset.assign(columns)


def outside(dataset: xr.Dataset, tree: FloatingTree) -> Array:
    """Recorded force and moment on the base from outside (all rows, 6); zero where they are not recorded."""
    names = [f"{kind}.{tree.body}.{axis}" for kind in ("force", "torque") for axis in "xyz"]
    none = np.zeros(dataset.sizes["time"])
    return np.stack([np.asarray(dataset[name].values, float) if name in dataset else none for name in names], 1)


def wheel_impulse(dataset: xr.Dataset, motion: Motion) -> Array:
    """Angular impulse that the wheels were told to give the base since the recording's start (n, 3) [N·m·s]."""
    time, given = dataset["time"].values, _impulse(dataset, told(dataset))
    return np.stack([np.interp(motion.time, time, x) for x in given.T], 1)


def told(dataset: xr.Dataset) -> Array:
    """Torque that reaction wheels were told to give the base (all rows, 3) [N·m]; zero where it is not recorded."""
    names = [f"torque.wheels.{axis}" for axis in "xyz"]
    none = np.zeros(dataset.sizes["time"])
    wheels = np.stack([np.asarray(dataset[name].values, float) if name in dataset else none for name in names], 1)
    if not np.isfinite(wheels).all():
        sample, axis = np.argwhere(~np.isfinite(wheels))[0]
        path, when = dataset.attrs.get("path", "recording"), dataset["time"].values[sample]
        raise InputError(
            f"{path}: {names[axis]} is missing at t = {when:g} s; wheels keep all that they were told to give, so that "
            "every sample is needed: fill it in, or cut the recording before it"
        )
    return wheels


def _impulse(dataset: xr.Dataset, wheels: Array) -> Array:
    return cumulative_trapezoid(wheels, np.asarray(dataset["time"].values, float), axis=0, initial=0.0)


_NEEDED = (("quat", QUATERNION), ("vel", "xyz"), ("omega", "xyz"))


def as_carriers(motion: Motion) -> Motion:
    """Motion of the carriers that give the base this twist: at zero, their rates are the twist.

    Second rates differ from the twist's, since the carriers turn in one another: by the base's spin cross its velocity,
    and by ``(w_y w_z, -w_x w_z, w_x w_y)``.
    """
    q, qd, qdd, tau = (x.copy("F") for x in (motion.q, motion.qd, motion.qdd, motion.tau))
    velocity, spin = q[:, :3].copy(), q[:, 3:CARRIERS].copy()
    rate = qd[:, :CARRIERS].copy()
    x, y, z = spin.T
    q[:, :CARRIERS] = 0.0
    qd[:, :3], qd[:, 3:CARRIERS] = velocity, spin
    qdd[:, :3] = rate[:, :3] + np.cross(spin, velocity)
    qdd[:, 3:CARRIERS] = rate[:, 3:] - np.stack([y * z, -x * z, x * y], 1)
    noise = np.where(np.arange(q.shape[1]) < CARRIERS, 0.0, motion.encoder_noise)  # `momentum_floor` has the twist's
    return replace(motion, q=q, qd=qd, qdd=qdd, tau=tau, encoder_noise=noise)


def twist_noise(dataset: xr.Dataset, tree: FloatingTree) -> Array:
    """Variance of white noise on each component of the twist (6,), from fourth differences: motion hardly has any."""
    columns = np.stack([np.asarray(dataset[f"q.{j.name}"].values, float) for j in tree.joints[:CARRIERS]], 1)
    return np.nanmean(np.diff(columns, 4, axis=0) ** 2, axis=0) / 70.0


def momentum_floor(experiment: "Experiment") -> Array:
    """RMS that the twist's noise leaves in the base's channels in the analysis band (6,) [N, N·m].

    Noise of density S [unit²/Hz] has the derivative's variance (2 pi)² S band³ / 3 up to the band's edge, and comes
    through the base's mass matrix.
    """
    motion = experiment.motion
    density = 2 * motion.period * experiment.store["twist_noise"]
    inertia = np.mean(experiment.mass_matrix[:, :CARRIERS, :CARRIERS], axis=0)
    return np.sqrt(inertia**2 @ density * (2 * np.pi) ** 2 * motion.band**3 / 3)


def base_signals(experiment: "Experiment") -> dict[str, Array]:
    """What a law at the base reads, each (n, 3), and time (n,)."""
    motion = experiment.motion
    x, y, z = spin = motion.qd[:, 3:CARRIERS].T
    gained = np.concatenate([spin.T[s] - spin.T[s][:1] for s in motion.segments])
    return {
        "spin": spin.T,
        "spin_gained": gained,
        "impulse": np.zeros_like(spin.T) if experiment.impulse is None else experiment.impulse,
        "spin_rate": motion.qdd[:, 3:CARRIERS] + np.stack([y * z, -x * z, x * y], 1),
        "acceleration": motion.qdd[:, :3],
        "time": experiment.elapsed,
    }
