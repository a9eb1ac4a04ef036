"""What a case may conceal, by name: from a machine, a joint and a size [N·m] to the machine that has it."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .laws import dip, hardening, table, warmth, zero_mean
from .machine import Drive, Extra, Machine, TooSoft, beside_known
from .motions import Motion
from .residuals import rms
from .robots import Rng, with_com, with_load

MOST = 0.7
"""Share of a channel's RMS torque that a concealed law may make: more no hardware has."""

CLOSE, TRIES = 0.03, 30


class TooMuch(ValueError):
    """No hardware has this effect at this size: another case is drawn."""


@dataclass(frozen=True, eq=False)
class Concealed:
    """A machine with an effect: where, on which channel it is largest, RMS [N·m], and true values that compare.

    ``hides``: laws that the model must not know at that joint.
    """

    machine: Machine
    at: str
    channel: int
    raw: float
    values: dict[str, float] = field(default_factory=dict)
    hides: tuple[str, ...] = ()


Maker = Callable[[Machine, Motion, int, NDArray, Rng], Concealed]
"""From a machine, its motion, a joint, and the RMS that the effect shall have on each channel (J,) [N·m]."""


def law(make: Callable[[Drive, int, Rng], Extra], *hides: str) -> Maker:
    """A law that is linear in its size: scaled so that what known friction leaves of it has the wanted RMS."""

    def made(machine: Machine, motion: Motion, k: int, wanted: NDArray, rng: Rng) -> Concealed:
        d = machine.drive(motion)
        unit = make(d, k, rng)
        column = unit(d)
        left = rms(column) if hides else beside_known(machine, d, k, column)
        size = float(wanted[k]) / max(left, 1e-12)
        raw = size * rms(column)
        if not raw <= MOST * rms(machine.torque(motion)[:, k]):
            raise TooMuch(f"{raw:.3g} N·m")
        return Concealed(machine.with_extra(k, lambda e: size * unit(e)), f"joint{k + 1}", k, raw, {}, hides)

    return made


def _stribeck(d: Drive, k: int, rng: Rng) -> Extra:
    speed = rng.uniform(0.03, 0.15) * np.abs(d.qd[:, k]).max()
    return lambda e: dip(e.qd[:, k], speed) * e.direction[:, k]


def _asymmetric(d: Drive, k: int, rng: Rng) -> Extra:
    return lambda e: np.abs(e.direction[:, k])


def _by_load(d: Drive, k: int, rng: Rng) -> Extra:
    return lambda e: np.abs(e.load[:, k]) * e.direction[:, k]


def _by_place(d: Drive, k: int, rng: Rng) -> Extra:
    period, knots = float(np.ptp(d.q[:, k]) * rng.uniform(0.3, 0.9)), zero_mean(rng, 5)
    return lambda e: table(e.q[:, k], period, knots) * e.direction[:, k]


def _quadratic(d: Drive, k: int, rng: Rng) -> Extra:
    power = float(rng.uniform(1.7, 2.3))
    return lambda e: np.abs(e.qd[:, k]) ** power * np.sign(e.qd[:, k])


def _ripple(d: Drive, k: int, rng: Rng) -> Extra:
    period, knots = float(np.ptp(d.q[:, k]) / rng.uniform(4.0, 12.0)), zero_mean(rng, 7)
    return lambda e: table(e.q[:, k], period, knots)


def _harness(d: Drive, k: int, rng: Rng) -> Extra:
    middle, share = float(rng.uniform(d.q[:, k].min(), d.q[:, k].max())), float(rng.uniform(0.0, 0.3))
    return lambda e: hardening(e.q[:, k] - middle, share)


def _gear(d: Drive, k: int, rng: Rng) -> Extra:
    return lambda e: np.abs(e.load[:, k]) * e.direction[:, k] * (e.load[:, k] * e.qd[:, k] > 0)


def _warming(d: Drive, k: int, rng: Rng) -> Extra:
    time = float(rng.uniform(4.0, 10.0))
    return lambda e: -warmth(np.abs(e.qd[:, k]), time) * e.direction[:, k]


def _hidden_rotor(machine: Machine, motion: Motion, k: int, wanted: NDArray, rng: Rng) -> Concealed:
    d = machine.drive(motion)
    inertia = wanted[k] / rms(d.qdd[:, k])
    if inertia * rms(d.qdd[:, k]) > MOST * rms(machine.torque(motion)[:, k]):
        raise TooMuch("rotor")
    rotor = machine.rotor.copy()
    rotor[k] = inertia
    changed = replace(machine, rotor=rotor)
    return Concealed(changed, f"joint{k + 1}", k, wanted[k], {"inertia": inertia}, ("rotor_inertia",))


def _hidden_level(machine: Machine, motion: Motion, k: int, wanted: NDArray, rng: Rng) -> Concealed:
    d = machine.drive(motion)
    column, v = d.direction[:, k], d.qd[:, k]
    left = rms(column - v * float(v @ column / (v @ v)))
    if wanted[k] > MOST * rms(machine.torque(motion)[:, k]):
        raise TooMuch("level")
    level = machine.level.copy()
    level[k] = wanted[k] / left
    values = {"level": float(level[k])}
    changed = replace(machine, level=level)
    return Concealed(changed, f"joint{k + 1}", k, wanted[k], values, ("coulomb_friction", "presliding_hysteresis"))


def by_search(make: Callable[[Machine, Motion, int, float, Rng], Machine], at: str, least: float, most: float) -> Maker:
    """An effect whose torque is not linear in its number: halved between bounds until the wanted RMS is met beside
    known friction, of a link on the channel where the effect is the largest share of it."""

    def made(machine: Machine, motion: Motion, k: int, wanted: NDArray, rng: Rng) -> Concealed:
        before, seed = machine.torque(motion), int(rng.integers(2**31))
        d = machine.drive(motion)
        low, high = least, most
        for _ in range(TRIES):
            number = float(np.sqrt(low * high))
            changed = make(machine, motion, k, number, np.random.default_rng(seed))
            try:
                apart = changed.read(changed.torque(motion)) - machine.read(before)
            except TooSoft:
                high = number
                continue
            shares = np.array([beside_known(machine, d, c, own) for c, own in enumerate(apart.T)]) / wanted
            c = int(np.argmax(shares)) if at == "link" else k
            if abs(shares[c] - 1.0) < CLOSE:
                raw = rms(apart[:, c])
                if raw > MOST * rms(before[:, c]):
                    break
                place = {"link": f"link{k + 1}", "joint": f"joint{k + 1}", "sensor": f"tau.joint{k + 1}"}[at]
                return Concealed(changed, place, c, raw)
            low, high = (number, high) if shares[c] < 1.0 else (low, number)
        raise TooMuch(f"{at} {k}")

    return made


def _load(machine: Machine, motion: Motion, k: int, mass: float, rng: Rng) -> Machine:
    place = rng.normal(size=3)
    return replace(machine, arm=with_load(machine.arm, k, mass, 0.12 * place / np.linalg.norm(place)))


def _com(machine: Machine, motion: Motion, k: int, shift: float, rng: Rng) -> Machine:
    way = rng.normal(size=3)
    return replace(machine, arm=with_com(machine.arm, k, shift * way / np.linalg.norm(way)))


def _spring(machine: Machine, motion: Motion, k: int, softness: float, rng: Rng) -> Machine:
    return replace(machine, bends=(*machine.bends, (k, lambda tau: softness * tau)))


def _play(machine: Machine, motion: Motion, k: int, half: float, rng: Rng) -> Machine:
    edge = 0.05 * rms(machine.torque(motion)[:, k])
    return replace(machine, bends=(*machine.bends, (k, lambda tau: half * tau / np.sqrt(tau**2 + edge**2))))


def _gain(machine: Machine, motion: Motion, k: int, error: float, rng: Rng) -> Machine:
    gain = machine.gain.copy()
    gain[k] *= 1.0 + error * rng.choice([-1.0, 1.0])
    return replace(machine, gain=gain)


def _saturating(machine: Machine, motion: Motion, k: int, share: float, rng: Rng) -> Machine:
    knee = float(np.quantile(np.abs(machine.torque(motion)[:, k]), rng.uniform(0.5, 0.8)))

    def more(tau: NDArray) -> NDArray:
        over = np.maximum(np.abs(tau) - knee, 0.0)
        return tau + np.sign(tau) * share * over**1.5 / np.sqrt(knee + 1e-9)

    return replace(machine, asked=(*machine.asked, (k, more)))


def _bias(machine: Machine, motion: Motion, k: int, wanted: NDArray, rng: Rng) -> Concealed:
    offset = machine.offset.copy()
    offset[k] += wanted[k] * rng.choice([-1.0, 1.0])
    return Concealed(replace(machine, offset=offset), f"tau.joint{k + 1}", k, wanted[k], {"bias": float(offset[k])})


def _drift(machine: Machine, motion: Motion, k: int, wanted: NDArray, rng: Rng) -> Concealed:
    drift = machine.drift.copy()
    length = len(motion[0]) * 1e-3
    drift[k] += wanted[k] * np.sqrt(3.0) / length * rng.choice([-1.0, 1.0])
    return Concealed(replace(machine, drift=drift), f"tau.joint{k + 1}", k, wanted[k], {"rate": float(drift[k])})


def _late(machine: Machine, motion: Motion, k: int, wanted: NDArray, rng: Rng) -> Concealed:
    tau = machine.torque(motion)
    slope = np.gradient(tau[:, k], 1e-3)
    delay = machine.delay.copy()
    delay[k] = wanted[k] / rms(slope)
    if delay[k] > 0.03:
        raise TooMuch("a position 30 ms late")
    return Concealed(replace(machine, delay=delay), f"q.joint{k + 1}", k, wanted[k], {"delay": float(delay[k])})


NAMES: dict[str, Maker] = {
    "stribeck_friction": law(_stribeck),
    "asymmetric_friction": law(_asymmetric),
    "load_dependent_friction": law(_by_load),
    "position_dependent_friction": law(_by_place),
    "quadratic_friction": law(_quadratic),
    "torque_ripple": law(_ripple),
    "harness_stiffness": law(_harness),
    "gear_efficiency": law(_gear),
    "heating_friction": law(_warming),
    "rotor_inertia": _hidden_rotor,
    "coulomb_friction": _hidden_level,
    "payload_mass": by_search(_load, "link", 1e-4, 30.0),
    "com_offset": by_search(_com, "link", 1e-5, 0.3),
    "joint_elasticity": by_search(_spring, "joint", 1e-8, 0.1),
    "backlash": by_search(_play, "joint", 1e-6, 0.05),
    "motor_saturation": by_search(_saturating, "joint", 1e-4, 2.0),
    "sensor_gain": by_search(_gain, "sensor", 1e-3, 0.6),
    "sensor_bias": _bias,
    "sensor_drift": _drift,
    "sensor_delay": _late,
}
