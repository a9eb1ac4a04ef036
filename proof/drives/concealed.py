"""Effects with a name: made of this generator's own laws, sized by the torque that they change.

A maker gets the planned motion, the joint, the size wanted as RMS [N·m] of every joint's channel, and random numbers.
The size counts in the channel where it is largest against the disturbance, and without what friction and rotor inertia
of the model, refitted, take of it: what a refit cancels is not concealed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .laws import CABLE, CHURNING, COGGING, ECCENTRIC, FILM, MESH, ONE_WAY, TABLE, along
from .plant import Law, Planned, Plant, rms
from .robots import Rng, with_body, with_com


class TooMuch(ValueError):
    """An effect would have to be larger than hardware has it; another case is drawn."""


@dataclass(frozen=True, eq=False)
class Made:
    """A plant with an effect: its name ('' where it has none) and place, numbers to compare, and other right names.

    ``hides``: (effect, joint) that the model must not list.
    """

    plant: Plant
    at: str
    channel: int
    raw: float
    values: Mapping[str, float] = field(default_factory=dict)
    also: tuple[str, ...] = ()
    hides: tuple[str, ...] = ()
    note: str = ""


Maker = Callable[[Planned, int, NDArray, Rng], Made]


def wave_table(rng: Rng, shares: tuple[float, ...]) -> NDArray:
    """A period of (TABLE,) with peak near 1: harmonics of these shares, with phases of their own."""
    turns = np.arange(TABLE) / TABLE
    phases = rng.uniform(0.0, 1.0, len(shares))
    waves = sum(x * np.sin(2.0 * np.pi * ((k + 1) * turns + phases[k])) for k, x in enumerate(shares))
    return np.asarray(waves) / sum(shares)


def law_torque(m: Planned, law: Law) -> NDArray:
    """Torque of a law of size 1 along the planned motion, (n_samples,)."""
    numbers = np.zeros(6)
    numbers[: len(law.numbers)] = law.numbers
    table = np.zeros(TABLE) if law.table is None else law.table
    k, o = law.at, law.other
    q, qd, direction, load, motor = (x[:, k].copy() for x in (m.q, m.qd, m.direction, m.load, m.torque))
    return along(
        law.number, numbers, table, m.period, q, qd, direction, load, motor, m.q[:, o].copy(), m.qd[:, o].copy()
    )


def factor(
    change: NDArray, m: Planned, wanted: NDArray, most: float, known_rotor: bool = True
) -> tuple[float, int, float]:
    """Multiple of a change (n_samples, n) that makes it as large as wanted; its channel; RMS there before any refit."""
    shares = rms(m.left(change, known_rotor)) / wanted
    channel = int(np.argmax(shares))
    found = float(1.0 / shares[channel])
    if not found <= most:
        raise TooMuch(f"{found:.3g} would be needed, {most:.3g} is the most")
    return found, channel, float(found * rms(change[:, channel]))


def at_joint(m: Planned, k: int, torque: NDArray) -> NDArray:
    """A torque (n_samples,) of joint k among zeros (n_samples, n)."""
    found = np.zeros_like(m.q)
    found[:, k] = torque
    return found


def place(k: int) -> str:
    """Name of joint k."""
    return f"joint{k + 1}"


def by_law(m: Planned, k: int, wanted: NDArray, law: Law, most: float, **more: Any) -> Made:
    """A law scaled to the wanted size, at most ``most`` of the joint's peak torque (by its own RMS)."""
    torque = law_torque(m, law)
    size, channel, raw = factor(at_joint(m, k, torque), m, wanted, np.inf)
    if raw > most * rms(m.torque[:, k]):
        raise TooMuch(f"an RMS of {raw:.3g} N·m would be needed at a joint of {rms(m.torque[:, k]):.3g} N·m")
    plant = replace(m.plant, laws=(*m.plant.laws, replace(law, size=size)))
    values = {name: share * size for name, share in more.pop("values", {}).items()}
    return Made(plant, place(k), channel, raw, values, **more)


def _stribeck(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    speed = float(np.abs(m.qd[:, k]).max() * rng.uniform(0.03, 0.15))
    made = by_law(m, k, wanted, Law(FILM, k, 1.0, (speed, float(rng.integers(3)))), 1.0)
    if made.plant.laws[-1].size > 1.5 * m.plant.friction.level[k]:
        raise TooMuch("static friction of more than 2.5 times the level")
    return made


def _asymmetric(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    made = by_law(m, k, wanted, Law(ONE_WAY, k, 1.0), 1.0, values={"level_difference": 1.0})
    if made.plant.laws[-1].size > 1.2 * m.plant.friction.level[k]:
        raise TooMuch("one direction with more than 2.2 times the level of the other")
    return made


def _load(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    made = by_law(m, k, wanted, Law(MESH, k, 1.0), 1.0, values={"coefficient": 1.0})
    if made.plant.laws[-1].size > 0.4:
        raise TooMuch("more than 40 % of the load")
    return made


def _position(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    period = float(np.ptp(m.q[:, k]) * rng.uniform(0.25, 1.2))
    law = Law(ECCENTRIC, k, 1.0, (period, float(rng.uniform())), wave_table(rng, (1.0, 0.2, 0.08)))
    made = by_law(m, k, wanted, law, 1.0)
    if made.plant.laws[-1].size > 0.95 * m.plant.friction.level[k]:
        raise TooMuch("friction would push")
    return made


def _quadratic(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    exponent = float(rng.choice([2.0, rng.uniform(1.8, 2.3)]))
    values = {"coefficient": 1.0} if exponent == 2.0 else {}
    return by_law(m, k, wanted, Law(CHURNING, k, 1.0, (exponent,)), 1.0, values=values)


def _ripple(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    period = float(np.ptp(m.q[:, k]) / rng.uniform(2.2, 20.0))
    table = wave_table(rng, (1.0, 0.15, 0.1))
    return by_law(m, k, wanted, Law(COGGING, k, 1.0, (period, float(rng.uniform())), table), 0.5)


def _harness(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    top = float(np.abs(m.q[:, k]).max())
    law = Law(CABLE, k, 1.0, (top * float(rng.uniform(-0.5, 0.5)), float(rng.uniform(0.0, 0.25)) / top**2))
    return by_law(m, k, wanted, law, 0.8)


def _rotor(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    size, channel, raw = factor(at_joint(m, k, m.qdd[:, k]), m, wanted, np.inf, known_rotor=False)
    own = float(np.ptp(m.load[:, k]) / np.ptp(m.qdd[:, k]))
    if size > 5.0 * own:
        raise TooMuch("a rotor of five times its link")
    rotor = m.plant.rotor.copy()
    rotor[k] = size
    return Made(replace(m.plant, rotor=rotor), place(k), channel, raw, {"inertia": size}, hides=("rotor_inertia",))


def _payload(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    robot, last = m.plant.robot, len(m.plant.robot.links) - 1
    link = robot.links[last]
    point = link.com + link.length * (np.array([0.0, 0.0, 0.4]) + 0.2 * rng.normal(size=3))
    edge = 0.25 * link.length
    change = m.loads(with_body(robot, last, 1.0, point, edge)) - m.load
    total = sum(x.mass for x in robot.links)
    mass, channel, raw = factor(change, m, wanted, 0.4 * total)
    plant = replace(m.plant, robot=with_body(robot, last, mass, point, edge))
    return Made(plant, f"link{last + 1}", channel, raw, {"mass": mass})


def _com(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    robot = m.plant.robot
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    length, size, channel, raw = robot.links[k].length, 0.05, 0, 0.0
    for _ in range(4):
        change = m.loads(with_com(robot, k, size * length * way)) - m.load
        more, channel, raw = factor(change, m, wanted, np.inf)
        size *= more
        if size > 0.4:
            raise TooMuch("a centre of mass 40 % of the link off")
    values = dict(zip("xyz", (size * length * way).tolist(), strict=True))
    return Made(replace(m.plant, robot=with_com(robot, k, size * length * way)), f"link{k + 1}", channel, raw, values)


def _sensed(m: Planned, k: int, change: NDArray, wanted: NDArray, most: float, what: str, value: str) -> Made:
    """A fault of torque channel k that is linear in a number."""
    size, channel, raw = factor(at_joint(m, k, change), m, wanted, most)
    sensors = replace(m.plant.sensors, **{what: {**getattr(m.plant.sensors, what), k: size}})
    values = {value: size}
    return Made(replace(m.plant, sensors=sensors), f"tau.joint{k + 1}", channel, raw, values)


def _bias(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    sign = float(rng.choice([-1.0, 1.0]))
    made = _sensed(m, k, np.full(len(m.q), 1.0), wanted, float(rms(m.torque[:, k])), "bias", "offset")
    size = sign * made.values["offset"]
    sensors = replace(m.plant.sensors, bias={**m.plant.sensors.bias, k: size})
    return replace(made, plant=replace(m.plant, sensors=sensors), values={"offset": size})


def _gain(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    return _sensed(m, k, m.torque[:, k], wanted, 0.4, "gain", "error")


def _drift(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    slow = float(rng.uniform(25.0, 80.0))
    time = m.period * np.arange(len(m.q))
    change = at_joint(m, k, 1.0 - np.exp(-time / slow))
    # A drift counts by what a constant leaves of it: with a constant alone it is a bias.
    change[:, k] -= change[:, k].mean()
    size, channel, raw = factor(change, m, wanted, 3.0 * float(rms(m.torque[:, k])))
    sensors = replace(m.plant.sensors, drift={**m.plant.sensors.drift, k: (size, slow)})
    return Made(replace(m.plant, sensors=sensors), f"tau.joint{k + 1}", channel, raw)


def _delay(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
    of_torque = bool(rng.integers(2))
    time = m.period * np.arange(len(m.q))
    late, channel, raw = 0.002, k, 0.0
    for _ in range(5):
        if of_torque:
            change = at_joint(m, k, np.interp(time - late, time, m.torque[:, k]) - m.torque[:, k])
        else:
            q, qd, qdd = m.q.copy(), m.qd.copy(), m.qdd.copy()
            for x in (q, qd, qdd):
                x[:, k] = np.interp(time - late, time, x[:, k])
            change = m.torque - Planned.along(m.plant, m.period, q, qd, qdd).torque
        more, channel, raw = factor(change, m, wanted, np.inf)
        late *= more
        if late > 0.06:
            raise TooMuch("a delay of more than 60 ms")
    what = "torque_delay" if of_torque else "position_delay"
    sensors = replace(m.plant.sensors, **{what: {**getattr(m.plant.sensors, what), k: late}})
    at = f"{'tau' if of_torque else 'q'}.joint{k + 1}"
    return Made(replace(m.plant, sensors=sensors), at, channel, raw, {"delay": late})


LAWS: dict[str, Maker] = {
    "stribeck_friction": _stribeck,
    "asymmetric_friction": _asymmetric,
    "load_dependent_friction": _load,
    "position_dependent_friction": _position,
    "quadratic_friction": _quadratic,
    "torque_ripple": _ripple,
    "rotor_inertia": _rotor,
    "payload_mass": _payload,
    "com_offset": _com,
    "harness_stiffness": _harness,
    "sensor_bias": _bias,
    "sensor_gain": _gain,
    "sensor_drift": _drift,
    "sensor_delay": _delay,
}
"""All but springs, by the name that is right."""
