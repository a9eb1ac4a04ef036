"""A position servo with a pendulum, simulated in its own closed loop along the goals that it was given.

    (m l² + J) a = tau - m g l sin(q + zero) - friction
    tau = torque per volt * (duty * volts - back-EMF * v), or 0 while the drive is off
    duty = gain * (goal - q) * DUTY, between -1 and 1

(Duclusaud et al. 2025; duty as the XL330's firmware works it out). Friction is the sum of the vocabulary's laws, with
sticking: what the joint needs to stop is given by friction up to the laws' own level, one implicit step at a time
(Stewart and Trinkle 1996). The load that a law reads is the pendulum's torque, m l² a + m g l sin(q + zero).
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..models.compiled import SampleFunction
from ..models.effects import effects

Array = NDArray[np.float64]

DUTY = 4096 / (2 * np.pi) / (256 * 885)
"""Duty per gain and radian: 4096 counts a turn, a divisor of 256, 885 counts of full duty."""

GRAVITY = 9.80665
SUBSTEPS = 4
"""Steps between two samples: a quarter of these change no position error by more than a hundredth."""

PASSES = 4
"""The load depends on the acceleration, that on friction, that on the load; each pass leaves a third of the rest."""

MOTOR = ("torque_per_volt", "back_emf", "rotor_inertia", "zero")
"""[N·m/V], [V·s/rad], [kg·m²], [rad] How far the encoder's zero is from hanging."""

FRICTION = (
    "viscous_friction",
    "coulomb_friction",
    "stribeck_friction",
    "load_dependent_friction",
    "quadratic_friction",
    "asymmetric_friction",
    "position_dependent_friction",
    "torque_ripple",
    "harness_stiffness",
)
"""Laws without memory that a servo's joint may have; an amplitude of zero switches one off."""


@dataclass(frozen=True)
class ServoRun:
    """One recording: time [s], position and goal [rad], whether the drive is on, supply [V], duty as measured, each
    (n,); the controller's gain, the pendulum's mass [kg] and length [m], and which trajectory it was."""

    name: str
    trajectory: str
    gain: float
    mass: float
    length: float
    time: Array
    position: Array
    goal: Array
    on: Array
    volts: Array
    duty: Array


def read_run(path: Path) -> ServoRun:
    """Read one of the publishers' JSON files.

    Raises
    ------
    InputError
        It is damaged, or an entry is missing.
    """
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
        keys = ("timestamp", "position", "goal_position", "torque_enable", "input_volts", "load")
        time, position, goal, on, volts, load = (np.array([e[k] for e in raw["entries"]], float) for k in keys)
        # Duty is a count of 16 bits with a sign.
        duty = np.where(load > 32767, load - 65536, load) / 885
        gain, mass, length = (float(raw[k]) for k in ("kp", "mass", "length"))
        trajectory = str(raw["trajectory"])
        return ServoRun(path.name, trajectory, gain, mass, length, time, position, goal, on, volts, duty)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: is no recording of the servo ({error!r}); fetch it again") from None


@cache
def parameters() -> tuple[str, ...]:
    """Names of all numbers of the servo's model: motor, then ``effect.parameter`` of every law."""
    return MOTOR + tuple(f"{name}.{p.name}" for name in FRICTION for p in effects()[name].parameters)


def simulate(run: ServoRun, values: Mapping[str, float]) -> Array:
    """Position (n,) [rad] that the servo takes at the recording's instants, from its first position at rest.

    Parameters
    ----------
    run : ServoRun
        Its goals, supply and gain are used, and the first position.
    values : mapping of str to float
        Some of `parameters`; those left out are zero, shape parameters one.
    """
    given = np.array([values.get(name, _usual(name)) for name in parameters()])
    step = np.repeat(np.diff(run.time) / SUBSTEPS, SUBSTEPS)
    held = [np.repeat(x[:-1], SUBSTEPS) for x in (run.goal, run.on, run.volts)]
    inputs = np.stack([*held, step], axis=1)
    start = np.array([run.position[0], 0.0, 0.0])
    constants = np.concatenate([given, [run.gain, run.mass, run.length]])
    return _step().scan(start, inputs, constants)[::SUBSTEPS, 0]


def position_error(runs: Sequence[ServoRun], values: Mapping[str, float]) -> float:
    """Mean absolute error of the simulated position, the mean over recordings [rad]."""
    return float(np.mean([np.mean(np.abs(simulate(r, values) - r.position)) for r in runs]))


def _usual(name: str) -> float:
    effect, _, own = name.partition(".")
    shapes = {p.name for p in effects()[effect].parameters if p.grid} if own else set()
    return 1.0 if own in shapes else 0.0


@cache
def _step() -> SampleFunction:
    """One step of state (q, v, a)."""
    x, u, c = ca.SX.sym("x", 3), ca.SX.sym("u", 4), ca.SX.sym("c", len(parameters()) + 3)
    q, v, before = x[0], x[1], x[2]
    goal, on, volts, h = u[0], u[1], u[2], u[3]
    p = dict(zip(parameters(), ca.vertsplit(c), strict=False))
    gain, mass, length = c[-3], c[-2], c[-1]
    inertia = mass * length**2 + p["rotor_inertia"]
    weight = mass * GRAVITY * length * ca.sin(q + p["zero"])
    duty = ca.fmin(ca.fmax(DUTY * gain * (goal - q), -1), 1)
    tau = on * p["torque_per_volt"] * (duty * volts - p["back_emf"] * v)
    free = v + h / inertia * (tau - weight)
    later, acceleration = free, before
    for _ in range(PASSES):
        load = mass * length**2 * acceleration + weight
        later = _stopped(free, h / inertia, q, load, p)
        acceleration = (later - v) / h
    state = ca.vertcat(q + h * later, later, acceleration)  # symplectic: no energy comes from the steps
    return SampleFunction(ca.Function("servo", [x, u, c], [state], ["x", "u", "c"], ["next"]))


def _stopped(free: ca.SX, mobility: ca.SX, q: ca.SX, load: ca.SX, p: Mapping[str, ca.SX]) -> ca.SX:
    """Velocity after friction: zero where friction's level is enough for that."""
    sense = ca.if_else(free < 0, -1, 1)
    least = 1e-9
    signals = {"q": q, "qd": sense * ca.fmax(ca.fabs(free), least), "load": load, "speed_scale": ca.SX(least)}
    total = ca.SX(0)
    for name in FRICTION:
        effect = effects()[name]
        total += effect.law(signals, {x.name: p[f"{name}.{x.name}"] for x in effect.parameters})
    slipped = free - mobility * total
    return ca.if_else(slipped * sense > 0, slipped, 0)
