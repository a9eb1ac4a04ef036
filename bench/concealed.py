"""What a plant can conceal: each effect at a joint or link of a random arm, sized by the torque it makes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from .arm import Arm
from .lugre import LuGre
from .parts import Elasticity, Harness, Payload, Ripple

FRICTION = ("viscous_friction", "coulomb_friction", "presliding_hysteresis")
"""What a model knows unless it is concealed."""


class TooMuch(ValueError):
    """An effect would have to be larger than hardware has it; draw another arm."""


@dataclass(frozen=True, eq=False)
class Planned:
    """A planned motion of an arm, arrays (n_samples, n_joints), and the joint that conceals something."""

    arm: Arm
    joint: int
    friction: LuGre
    q: NDArray
    qd: NDArray
    qdd: NDArray
    period: float

    def torque(self, arm: Arm | None = None, q: NDArray | None = None) -> NDArray:
        """Rigid-body torque (n_samples, n_joints) of another arm, or along other positions."""
        moves = [self.q, self.qd, self.qdd]
        if q is not None:
            qd = np.gradient(q, self.period, axis=0)
            moves = [q, qd, np.gradient(qd, self.period, axis=0)]
        model = mujoco.MjModel.from_xml_string((arm or self.arm).mjcf())  # pyright: ignore[reportAttributeAccessIssue]
        data = mujoco.MjData(model)  # pyright: ignore[reportAttributeAccessIssue]
        found = np.empty_like(self.q)
        for k, (data.qpos[:], data.qvel[:], data.qacc[:]) in enumerate(zip(*moves, strict=True)):
            mujoco.mj_inverse(model, data)  # pyright: ignore[reportAttributeAccessIssue]
            found[k] = data.qfrc_inverse
        return found

    def amount(self, torque: NDArray, rms: float, most: float, known: Sequence[str] = ("level", "viscous")) -> float:
        """Multiple of ``torque`` whose RMS [T] is this after known friction took its part; refused above ``most``.

        ``torque`` is at the chosen joint (n_samples,), or at all (n_samples, n_joints): then the largest RMS counts.
        """
        own = torque.ndim == 1
        left = []
        for x, qd in zip(np.atleast_2d(torque.T), self.qd.T[[self.joint]] if own else self.qd.T, strict=True):
            columns = np.stack([{"level": np.sign(qd), "viscous": qd}[name] for name in known], axis=1)
            left.append(x - columns @ np.linalg.lstsq(columns, x)[0])
        found = float(rms / np.sqrt(np.mean(np.square(left), axis=1)).max())
        if found > most:
            raise TooMuch(f"{found:.3g} would be needed, {most:.3g} is the most that hardware has")
        return found

    @property
    def name(self) -> str:
        """The chosen joint's."""
        return self.arm.joints[self.joint]

    @property
    def own(self) -> tuple[NDArray, NDArray, NDArray]:
        """The chosen joint's q, qd, qdd (n_samples,)."""
        return self.q[:, self.joint], self.qd[:, self.joint], self.qdd[:, self.joint]

    @property
    def smooth_torque(self) -> NDArray:
        """At the chosen joint, with viscous friction and without the level (n_samples,)."""
        return self.torque()[:, self.joint] + self.friction.viscous * self.own[1]


@dataclass(frozen=True, eq=False)
class Concealed:
    """What the plant has and the model has not.

    ``at`` is its place, ``value`` its size, ``law`` the chosen joint's friction where it is that, ``plant`` other parts
    of the plant. The model knows the effects ``knows``, but none of ``unknown`` at that joint: those are right names
    too.
    """

    at: str
    value: float
    law: LuGre | None = None
    plant: Mapping[str, Any] = field(default_factory=dict)
    knows: tuple[str, ...] = FRICTION
    unknown: tuple[str, ...] = ()


Rng = np.random.Generator
Maker = Callable[[Planned, float, Rng], Concealed]
"""Planned motion, RMS [T] of the torque that known friction cannot pose as, random numbers."""


def _signed(make: Callable[[Planned, float, float, Rng], Concealed]) -> Maker:
    """A maker that is told a random sign."""
    return lambda m, rms, rng: make(m, rms, float(rng.choice([-1.0, 1.0])), rng)


def _coulomb(m: Planned, rms: float, sign: float, rng: Rng) -> Concealed:
    x = m.amount(np.sign(m.own[1]), rms, 10.0, ("viscous",))
    # Where the level is concealed, so are the bristles that carry it.
    return Concealed(m.name, x, replace(m.friction, level=x), unknown=("coulomb_friction", "presliding_hysteresis"))


def _stribeck(m: Planned, rms: float, sign: float, rng: Rng) -> Concealed:
    qd = m.own[1]
    speed = float(np.abs(qd).max() * rng.uniform(0.04, 0.15))
    x = m.amount(np.exp(-((qd / speed) ** 2)) * np.sign(qd), rms, 1.5 * m.friction.level)
    return Concealed(m.name, x, replace(m.friction, static=m.friction.level + x, stribeck_speed=speed))


def _asymmetric(m: Planned, rms: float, sign: float, rng: Rng) -> Concealed:
    x = sign * m.amount(np.full(len(m.q), 0.5), rms, 0.8 * m.friction.level)
    return Concealed(m.name, x, replace(m.friction, level_negative=m.friction.level - x))


def _load_dependent(m: Planned, rms: float, sign: float, rng: Rng) -> Concealed:
    x = m.amount(np.abs(m.torque()[:, m.joint]) * np.sign(m.own[1]), rms, 0.4)
    return Concealed(m.name, x, replace(m.friction, load_factor=x))


def _position_dependent(m: Planned, rms: float, sign: float, rng: Rng) -> Concealed:
    q, qd, _ = m.own
    period = float(np.ptp(q)) * float(rng.uniform(0.2, 1.0))
    x = m.amount(np.sin(2 * np.pi * q / period) * np.sign(qd), rms, 0.8 * m.friction.level)
    return Concealed(m.name, x, replace(m.friction, variation=x / m.friction.level, period=period))


def _ripple(m: Planned, rms: float, sign: float, rng: Rng) -> Concealed:
    cycles = 2 * np.pi / float(np.ptp(m.own[0])) * float(rng.uniform(3.0, 20.0))
    x = m.amount(np.sin(cycles * m.own[0]), rms, 20.0)
    phase = float(rng.uniform(0, 2 * np.pi))
    return Concealed(m.name, x, plant={"ripple": {m.name: Ripple(x, cycles, phase)}})


def _rotor(m: Planned, rms: float, sign: float, rng: Rng) -> Concealed:
    x = m.amount(m.own[2], rms, 20.0)
    return Concealed(m.name, x, plant={"armature": {m.name: x}})


def _harness(m: Planned, rms: float, sign: float, rng: Rng) -> Concealed:
    rest = float(rng.uniform(-0.3, 0.3))
    x = m.amount(m.own[0] - rest, rms, 100.0)
    return Concealed(m.name, x, plant={"harness": {m.name: Harness(x, rest)}})


def _bias(m: Planned, rms: float, sign: float, rng: Rng) -> Concealed:
    x = sign * m.amount(np.ones(len(m.q)), rms, 20.0)
    return Concealed(f"tau.{m.name}", x, plant={"tau_bias": {m.name: x}})


def _gain(m: Planned, rms: float, sign: float, rng: Rng) -> Concealed:
    x = sign * m.amount(m.smooth_torque + m.friction.level * np.sign(m.own[1]), rms, 0.3)
    return Concealed(f"tau.{m.name}", x, plant={"tau_gain": {m.name: 1.0 + x}})


def _delay(m: Planned, rms: float, sign: float, rng: Rng) -> Concealed:
    x = m.amount(np.gradient(m.smooth_torque, m.period), rms, 0.03)
    return Concealed(f"tau.{m.name}", x, plant={"tau_delay": {m.name: x}})


def _payload(m: Planned, rms: float, rng: Rng) -> Concealed:
    point = m.arm.links[-1].com + rng.uniform(-0.1, 0.1, 3)
    x = m.amount(m.torque(m.arm.with_payload(1.0, point)) - m.torque(), rms, 10.0)
    return Concealed(f"link{len(m.arm.links)}", x, plant={"payload": Payload(x, tuple(point))})


def _com_offset(m: Planned, rms: float, rng: Rng) -> Concealed:
    link, way = f"link{m.joint + 1}", rng.normal(size=3)
    way /= np.linalg.norm(way)
    x = m.amount((m.torque(m.arm.with_com_offset(link, 1e-3 * way)) - m.torque()) / 1e-3, rms, 0.15)
    return Concealed(link, x, plant={"com_offset": {link: tuple(x * way)}})


def _elasticity(m: Planned, rms: float, rng: Rng) -> Concealed:
    """A drive soft enough to show, whose link still rings above the servo's band (at 5 Hz or more)."""
    load = m.torque()
    twist = np.zeros_like(m.q)
    twist[:, m.joint] = 1e-4 * load[:, m.joint]
    bent = load - m.torque(q=m.q - twist)
    pushed = replace(m, qdd=m.qdd + np.eye(m.q.shape[1])[m.joint])
    inertia = float(np.mean(pushed.torque()[:, m.joint] - load[:, m.joint]))
    x = 1.0 / m.amount(bent / 1e-4, rms, 1.0 / ((2 * np.pi * 5.0) ** 2 * inertia))
    spring, rotor = Elasticity(x, x * float(rng.uniform(0.003, 0.008))), inertia * float(rng.uniform(0.5, 2.0))
    plant = {"armature": {m.name: rotor}, "elasticity": {m.name: spring}}
    return Concealed(m.name, x, None, plant, (*FRICTION, "rotor_inertia"))


MAKERS: dict[str, Maker] = {
    "coulomb_friction": _signed(_coulomb),
    "stribeck_friction": _signed(_stribeck),
    "asymmetric_friction": _signed(_asymmetric),
    "load_dependent_friction": _signed(_load_dependent),
    "position_dependent_friction": _signed(_position_dependent),
    "torque_ripple": _signed(_ripple),
    "rotor_inertia": _signed(_rotor),
    "harness_stiffness": _signed(_harness),
    "sensor_bias": _signed(_bias),
    "sensor_gain": _signed(_gain),
    "sensor_delay": _signed(_delay),
    "payload_mass": _payload,
    "com_offset": _com_offset,
    "joint_elasticity": _elasticity,
}
