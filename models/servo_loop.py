"""A position servo with a pendulum, simulated in its own closed loop along the goals that it was given.

    (m l² + J) a = tau - m g l sin(q + zero) - friction
    tau = torque per volt * (duty * volts - back-EMF * v), or 0 while the drive is off
    duty = gain * (goal - q), between -1 and 1

(Duclusaud et al. 2025). Friction is the sum of the vocabulary's laws, with sticking: what the joint needs to stop is
given by friction up to the laws' own level, one implicit step at a time (Stewart and Trinkle 1996). The load that a law
reads is the pendulum's torque, m l² a + m g l sin(q + zero).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .compiled import SampleFunction
from .effect import Effect, Parameter, Symbols
from .effects import effects, get_effect
from .hidden_state import reads

Array = NDArray[np.float64]

GRAVITY = 9.80665
SUBSTEPS = 4
"""Steps between two samples: a quarter of these change no position error by more than a hundredth."""

PASSES = 4
"""The load depends on the acceleration, that on friction, that on the load; each pass leaves a third of the rest."""

LEAST = 1e-9
"""[rad/s] Speed at which a law's level at rest is read."""


@dataclass(frozen=True)
class ServoRun:
    """One recording: time [s], position and goal [rad], whether the drive is on and supply [V], each (n,); the
    controller's gain [1/rad], duty for a position error; the pendulum's mass [kg] and length [m]."""

    name: str
    gain: float
    mass: float
    length: float
    time: Array
    position: Array
    goal: Array
    on: Array
    volts: Array


def _drive(s: Symbols, p: Symbols) -> ca.SX:
    return -p["torque_per_volt"] * (s["volts"] - p["back_emf"] * s["qd"])


DRIVE = Effect(
    name="servo_drive",
    family="drive train",
    at="joint",
    sentence="the motor's torque for its voltage, and where its encoder is zero",
    equation="-torque_per_volt * (volts - back_emf * qd)",
    source="Duclusaud et al. (2025)",
    parameters=(
        Parameter("torque_per_volt", "T/V", "torque per volt at standstill", low=1e-6),
        Parameter("back_emf", "V*s/S", "voltage per speed", low=1e-6),
        Parameter("zero", "S", "how far the encoder's zero is from hanging"),
    ),
    law=_drive,
)
"""Numbers of the motor, of which a recording of its goals and positions says what no data sheet does."""

ROTOR = get_effect("rotor_inertia")


@cache
def laws() -> tuple[Effect, ...]:
    """The vocabulary's laws without memory that a servo's joint may have: of position, speed and load."""
    known = {"q", "qd", "load", "speed_scale"}
    return tuple(
        e
        for e in effects().values()
        if e.at == "joint" and e.acts_on == "torque" and e.neighbours != "only" and not e.states
        and known.issuperset(reads(e))
    )  # fmt: skip


@cache
def parameters() -> tuple[str, ...]:
    """Names ``effect.parameter`` of all numbers of the servo's model: drive, rotor, and every law."""
    return tuple(f"{e.name}.{x.name}" for e in (DRIVE, ROTOR, *laws()) for x in e.parameters)


def simulate(run: ServoRun, values: Mapping[str, float]) -> Array:
    """Position (n,) [rad] that the servo takes at the recording's instants, from its first position at rest.

    Parameters
    ----------
    run : ServoRun
        Its goals, supply and gain are used, and the first position.
    values : mapping of str to float
        Some of `parameters`; of those left out amplitudes are zero, shapes one.
    """
    given = np.array([values.get(name, usual) for name, usual in zip(parameters(), _absent(), strict=True)])
    step = np.repeat(np.diff(run.time) / SUBSTEPS, SUBSTEPS)
    held = [np.repeat(x[:-1], SUBSTEPS) for x in (run.goal, run.on, run.volts)]
    inputs = np.stack([*held, step], axis=1)
    start = np.array([run.position[0], 0.0, 0.0])
    constants = np.concatenate([given, [run.gain, run.mass, run.length]])
    return _step().scan(start, inputs, constants)[::SUBSTEPS, 0]


@cache
def _absent() -> tuple[float, ...]:
    return tuple(float(bool(x.grid)) for e in (DRIVE, ROTOR, *laws()) for x in e.parameters)


@cache
def _step() -> SampleFunction:
    """One step of state (q, v, a)."""
    x, u, c = ca.SX.sym("x", 3), ca.SX.sym("u", 4), ca.SX.sym("c", len(parameters()) + 3)
    q, v, before = x[0], x[1], x[2]
    goal, on, volts, h = ca.vertsplit(u)
    p = dict(zip(parameters(), ca.vertsplit(c), strict=False))
    gain, mass, length = c[-3], c[-2], c[-1]
    inertia = mass * length**2 + p["rotor_inertia.inertia"]
    # Forces at the middle of the step: its error is of second order.
    middle = q + h / 2 * v
    weight = mass * GRAVITY * length * ca.sin(middle + p["servo_drive.zero"])
    duty = ca.fmin(ca.fmax(gain * (goal - middle), -1), 1)
    later, acceleration = v, before
    for _ in range(PASSES):
        mean = (v + later) / 2
        tau = -on * _law(DRIVE, {"volts": duty * volts, "qd": mean}, p)
        load = mass * length**2 * acceleration + weight
        later = _stopped(v + h / inertia * (tau - weight), h / inertia, {"q": middle, "qd": mean, "load": load}, p)
        acceleration = (later - v) / h
    state = ca.vertcat(q + h * (v + later) / 2, later, acceleration)
    return SampleFunction(ca.Function("servo", [x, u, c], [state], ["x", "u", "c"], ["next"]))


def _stopped(free: ca.SX, mobility: ca.SX, at: Symbols, p: Mapping[str, ca.SX]) -> ca.SX:
    """Velocity after friction: zero where friction's level is enough for that."""
    sense = ca.if_else(free < 0, -1, 1)
    signals = {**at, "qd": sense * ca.fmax(ca.fabs(at["qd"]), LEAST), "speed_scale": ca.SX(LEAST)}
    slipped = free - mobility * sum((_law(e, signals, p) for e in laws()), ca.SX(0))
    return ca.if_else(slipped * sense > 0, slipped, 0)


def _law(effect: Effect, signals: Symbols, p: Mapping[str, ca.SX]) -> ca.SX:
    return effect.law(signals, {x.name: p[f"{effect.name}.{x.name}"] for x in effect.parameters})
