"""Identified constants of drives: a torque channel's gain, a servo's stiffness and damping.

The recording has y, a current or a servo's error command - q; the torque is y times an unknown constant. The fit
predicts the reading, which carries the noise:

    y * nominal = (tau + damping * qd) * nominal / constant

with tau the model's torque. ``nominal`` is a first estimate by plain least squares on the training recordings; it puts
the channel into N·m, which bounds, grids and weights refer to, and drops out of the result. The constant rests on the
model's masses: were these, and the friction with them, larger by a factor, it would be larger by the same.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import InputError
from ...models.effect import Effect, Parameter, Symbols
from ...models.model import Model, PlacedEffect
from ...models.rigid_body import RigidBody
from ...models.servo import Servo
from ...recordings.columns import split_header
from ...recordings.signals import FREE
from .experiment import Experiment, load_experiments
from .fit import Fit

Array = NDArray[np.float64]

GAIN, SERVO = "gain", "servo"
_CONSTANT = {GAIN: "gain", SERVO: "stiffness"}
"""What each kind of constant is called, by the name of its effect."""


def with_constants(
    model: Model, datasets: Sequence[xr.Dataset], n_train: int
) -> tuple[Model, list[xr.Dataset], tuple[str, ...]]:
    """The model with its drives' constants among its effects, recordings in N·m or N, and notes; all unchanged where
    the model has no free constant.

    Parameters
    ----------
    model : Model
    datasets : sequence of xarray.Dataset
        As read; the first ``n_train`` are for training, and the estimate to start from is made on those alone.
    n_train : int

    Raises
    ------
    InputError
        A constant that no recorded motion can tell, because the model's masses ask for no torque there.
    """
    unknown = _unknown(model)
    if not unknown and not model.servo:
        return model, list(datasets), ()
    nominal = _nominal(model, datasets[:n_train], unknown) if unknown else {}
    added, values, notes = [], {}, []
    signals, servos = dict(model.signals), dict(model.servo)
    for joint in model.joints:
        name = f"tau.{joint}"
        if joint in servos:
            servo = servos[joint]
            stiffness = nominal[joint] if servo.stiffness is None else servo.stiffness
            place = PlacedEffect(_servo(), joint, _held(model, joint, servo))
            values |= {f"{place.key}.damping": servo.damping or 0.0}
            notes += _shared(model, joint, servo)
            servos[joint] = replace(servo, stiffness=stiffness)
        elif joint in nominal:
            stiffness = nominal[joint]
            place = PlacedEffect(_gain(_per(model, datasets[0], name)), name, ("nominal",))
            signals[name] = replace(signals[name], gain=stiffness)
        else:
            continue
        added.append(place)
        values |= {f"{place.key}.{x}": stiffness for x in (_CONSTANT[place.effect.name], "nominal")}
    # First among the sensors: what else a channel does, it does to the reading.
    effects = (*added, *model.effects)
    model = replace(model, effects=effects, values={**model.values, **values}, signals=signals, servo=servos)
    scaled = [
        d.assign({f"tau.{j}": (d[f"tau.{j}"] * k).assign_attrs(d[f"tau.{j}"].attrs) for j, k in nominal.items()})
        for d in datasets
    ]
    return model, scaled, tuple(notes)


def settled(model: Model) -> Model:
    """The model with its drives' constants as numbers where its file has them, and no longer among its effects."""
    signals, servos = dict(model.signals), dict(model.servo)
    for p in model.effects:
        if p.effect.name == GAIN:
            signals[p.at] = replace(signals[p.at], gain=model.values[f"{p.key}.gain"])
        if p.effect.name == SERVO:
            servos[p.at] = Servo(model.values[f"{p.key}.stiffness"], model.values[f"{p.key}.damping"])
    gone = {p.key for p in model.effects if p.effect.name in _CONSTANT}
    return replace(
        model,
        effects=tuple(p for p in model.effects if p.key not in gone),
        values={key: x for key, x in model.values.items() if key.rpartition(".")[0] not in gone},
        signals=signals,
        servo=servos,
    )


def notes_on(found: Fit) -> tuple[str, ...]:
    """On what each identified constant depends, in words."""
    notes = []
    for slot, value, std in zip(found.assembly.slots, found.theta, found.std, strict=True):
        if slot.name != _CONSTANT.get(slot.effect):
            continue
        known = f"± {std:.2g} " if np.isfinite(std) else ""
        rest = (
            "the other torques and the masses fitted to them"
            if found.assembly.base is not None
            else "the model's masses"
        )
        text = (
            f"{slot.effect} at {slot.at}: {slot.name} {value:.4g} {known}{slot.unit} rests on {rest}: were all masses "
            "larger by a factor, and friction with them, it would be larger by the same"
        )
        if not std < abs(value):
            text = f"{slot.effect} at {slot.at}: these recordings do not tell the {slot.name}; write it as a number"
        notes.append(text)
    return tuple(notes)


@cache
def _gain(unit: str) -> Effect:
    def law(s: Symbols, p: Symbols) -> ca.SX:
        return s["value"] * p["nominal"] / p["gain"]

    return Effect(
        name=GAIN,
        family="measurement",
        at="sensor",
        sentence="a torque channel's constant is unknown",
        equation="value * nominal / gain",
        source="JCGM 200:2012, 4.12 (sensitivity of a measuring system)",
        parameters=(
            Parameter("gain", unit, "torque per unit of the column", zero=1.0),
            Parameter("nominal", unit, "gain that the recording was read with", zero=1.0),
        ),
        law=law,
    )


@cache
def _servo() -> Effect:
    def law(s: Symbols, p: Symbols) -> ca.SX:
        return (s["value"] + p["damping"] * s["qd"]) * p["nominal"] / p["stiffness"]

    return Effect(
        name=SERVO,
        family="measurement",
        at="sensor",
        sentence="a servo's constants are unknown",
        equation="(value + damping * qd) * nominal / stiffness",
        source="Duclusaud et al. (2025)",
        parameters=(
            Parameter("stiffness", "T/S", "torque per position error", zero=1.0),
            Parameter("damping", "T*s/S", "torque taken per speed", low=0.0),
            Parameter("nominal", "T/S", "stiffness that the torque was worked out with", zero=1.0),
        ),
        law=law,
    )


def _unknown(model: Model) -> tuple[str, ...]:
    """Joints whose torque has a constant that is not known."""
    return tuple(
        j
        for j in model.joints
        if (f"tau.{j}" in model.signals and model.signals[f"tau.{j}"].gain == FREE)
        or (j in model.servo and model.servo[j].stiffness is None)
    )


def _viscous(model: Model, joint: str) -> bool:
    return any(_damps(p.effect) and p.at == joint and not p.hold for p in model.effects)


@cache
def _damps(effect: Effect) -> bool:
    """Is a law in proportion to the joint's speed, and no more?"""
    if effect.at != "joint" or effect.states or effect.others or effect.acts_on != "torque":
        return False
    speed = ca.SX.sym("qd")
    signals = defaultdict(lambda: ca.SX.sym("another"), {"qd": speed})
    law = effect.law(signals, {p.name: ca.SX(p.grid[0] if p.grid else 1.0) for p in effect.parameters})
    slope = ca.simplify(ca.jacobian(law, speed))
    return len(signals) == 1 and not ca.symvar(slope) and float(slope) != 0.0


def _held(model: Model, joint: str, servo: Servo) -> tuple[str, ...]:
    held = ["nominal"] + (["stiffness"] if servo.stiffness is not None else [])
    return tuple(held + (["damping"] if servo.damping is not None or _viscous(model, joint) else []))


def _shared(model: Model, joint: str, servo: Servo) -> list[str]:
    if servo.damping is not None or not _viscous(model, joint):
        return []
    return [
        f"servo at {joint}: its damping and viscous friction there take the same torque; what is identified as viscous "
        "friction is the sum of both, and the damping is written as 0"
    ]


def _per(model: Model, dataset: xr.Dataset, name: str) -> str:
    """Unit of a gain: the torque's per that of the column, where one is written."""
    column = split_header(str(dataset[name].attrs.get("column", "")))[1]
    unit = model.signals[name].unit or column or ""
    return f"T/({unit})" if "*" in unit or "/" in unit else f"T/{unit}" if unit else "T"


def _nominal(model: Model, train: Sequence[xr.Dataset], unknown: Sequence[str]) -> dict[str, float]:
    """First estimates: the reading as a sum of the rigid body's torque, friction and a bias."""
    paths = [str(d.attrs.get("path", "recording")) for d in train]
    experiments = load_experiments(model, paths, RigidBody(model.tree), datasets=train)
    found = {}
    for joint in unknown:
        c = model.joints.index(joint)
        columns = np.concatenate([_regressors(e, c) for e in experiments])
        measured = np.concatenate([e.measured[:, c] for e in experiments])
        size = np.sqrt(np.mean(columns**2, axis=0))
        if not size[0] > 1e-9 or not np.any(measured):
            raise InputError(
                f"{model.path}: the constant of tau.{joint} is free, and the recorded motion asks for no torque of the "
                "model's masses there, or the channel reads zero; write the constant as a number"
            )
        use = size > 0
        share = np.linalg.lstsq(columns[:, use] / size[use], measured, rcond=None)[0][0] / size[0]
        # A reading that follows the rigid body not at all still needs a size to start from.
        least = np.sqrt(np.mean(measured**2)) / size[0] * 1e-6
        found[joint] = 1.0 / (share if abs(share) > least else least)
    return found


def _regressors(e: Experiment, c: int) -> Array:
    qd = e.motion.qd[:, c]
    return e.to_band(np.stack([e.modelled[:, c], qd, np.sign(qd), np.ones(len(qd))], 1), c)
