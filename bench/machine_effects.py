"""What a machine of ``bench/machines.py`` can conceal, one entry a mechanism, each sized by the torque it makes.

A maker gets the planned motion, the RMS [T] that the mechanism's torque has after known friction (a level and viscous)
took its part, and random numbers.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from snarelab.errors import InputError
from snarelab.models.effects import get_effect

from .concealed import Planned, Rng, TooMuch
from .machine_beams import beam
from .machine_laws import Grease, froehlich, froehlich_asked, gear_loss, slots, tanh_asked, tanh_motor
from .machine_parts import Gear, Heating, Iron, Law, Queue
from .parts import Bumper, Tie

STEP = 2.5e-4  # s, MuJoCo's
AXES = ("motor_a", "motor_b")
"""A wrist's motors in the model file: one turns the sum of two joints, the other their difference."""


@dataclass(frozen=True, eq=False)
class Hidden:
    """What a plant has and its model has not.

    ``truths``: every name that is right, with its place. ``value``: its size. ``plant``: fields of the `Plant`.
    ``axes``: axes that the model file states, factors by joint. ``heating``: its temperature is recorded.
    """

    truths: tuple[tuple[str, str], ...] = ()
    value: float = 0.0
    plant: Mapping[str, Any] = field(default_factory=dict)
    axes: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    heating: Heating | None = None


Maker = Callable[[Planned, float, Rng], Hidden]


def _gear(m: Planned, rms: float, rng: Rng) -> Hidden:
    """Costs most while it drives, as a worm does, or while it brakes, as a harmonic drive may."""
    load, qd = m.torque()[:, m.joint], m.own[1]
    scale = 0.05 * float(np.sqrt(np.mean((load * qd) ** 2)))
    less = float(rng.uniform(0.0, 0.3))
    driving, braking = (1.0, less) if rng.random() < 0.5 else (less, 1.0)
    x = m.amount(gear_loss(load, qd, driving, braking, scale), rms, 0.5)
    gear = Gear(m.name, x * driving, x * braking, scale)
    return Hidden((("gear_efficiency", m.name),), x, {"mechanisms": (gear,)})


def _motor(m: Planned, rms: float, rng: Rng) -> Hidden:
    """By Fröhlich or by a tanh; the knee is halved between bounds until the current in excess has its size."""
    law, inverse, nearest = ((froehlich, froehlich_asked, 2.0), (tanh_motor, tanh_asked, 1.15))[int(rng.integers(2))]
    given = m.smooth_torque + m.friction.level * np.sign(m.own[1])
    low, high = nearest * float(np.abs(given).max()), 1e4 * float(np.abs(given).max())
    if m.amount(inverse(given, low) - given, rms, np.inf) > 1.0:
        raise TooMuch("a motor that can hardly hold its load would be needed")
    for _ in range(40):
        knee = float(np.sqrt(low * high))
        too_little = m.amount(inverse(given, knee) - given, rms, np.inf) > 1.0
        low, high = (low, knee) if too_little else (knee, high)
    iron = Iron(lambda asked: float(law(asked, high)))
    return Hidden((("motor_saturation", f"tau.{m.name}"),), high, {"motor": {m.name: iron}})


def _heating(recorded: bool) -> Maker:
    def make(m: Planned, rms: float, rng: Rng) -> Hidden:
        time = float(rng.uniform(4.0, 12.0))
        qd, hottest, span = m.own[1], float(rng.uniform(15.0, 30.0)), 15.0
        cold = m.friction.level * np.sign(qd) + m.friction.viscous * qd
        unit, theta = Grease(1.0, time, 1.0, span), [0.0]
        for power in (cold * qd)[:-1].tolist():
            theta.append(unit.warmed(theta[-1], power, m.period))
        # Temperature goes as one over the heat capacity; that friction falls meanwhile cools it a little.
        capacity = max(theta) / hottest
        x = m.amount(unit.lost(np.array(theta) / capacity) * cold, rms, 0.75)
        part = Heating(m.name, Grease(capacity, time, x, span))
        hidden = {"mechanisms": (part,)}
        return Hidden((("heating_friction", m.name),), x, hidden, heating=part if recorded else None)

    return make


def _pair(m: Planned, sign: float) -> tuple[str, str, NDArray]:
    """A joint, the one that it carries, and how far each goes along with their axis (n_joints,)."""
    k = min(m.joint, len(m.arm.links) - 2)
    along = np.zeros(len(m.arm.links))
    along[[k, k + 1]] = 1.0, sign
    return m.arm.joints[k], m.arm.joints[k + 1], along


def _sign(rng: Rng) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _joint_spring(m: Planned, rms: float, rng: Rng) -> Hidden:
    """A torsion spring or a belt, whose cubic part is a tenth to a third of the linear one at its longest."""
    sign = _sign(rng)
    first, second, along = _pair(m, sign)
    rest = float(rng.uniform(-0.3, 0.3))
    w = m.q @ along - rest
    cubic = float(rng.uniform(0.1, 0.33)) / float(np.abs(w).max()) ** 2
    x = m.amount((w + cubic * w**3)[:, None] * along, rms, 100.0)
    tie = Tie(first, second, sign, stiffness=x, cubic=cubic * x, rest=rest)
    at = f"{first}{'+' if sign > 0 else '-'}{second}"
    return Hidden((("joint_spring", at),), x, {"ties": (tie,)})


def _stated(first: str, second: str) -> dict[str, dict[str, float]]:
    return {name: {first: 1.0, second: sign} for name, sign in zip(AXES, (1.0, -1.0), strict=True)}


def _wrist(name: str, part: str, shape: Callable[[NDArray], NDArray], most: float, stated: bool = True) -> Maker:
    """One of both motors has what a tie's ``part`` is; ``shape`` of w' or w'' is its torque. The model states both
    motors, or knows of none."""

    def make(m: Planned, rms: float, rng: Rng) -> Hidden:
        motor = int(rng.integers(2))
        sign = (1.0, -1.0)[motor]
        first, second, along = _pair(m, sign)
        rate = (m.qdd if part == "armature" else m.qd) @ along
        x = m.amount(shape(rate)[:, None] * along, rms, most)
        tie = Tie(first, second, sign, **{part: x})
        if stated:
            return Hidden(((name, AXES[motor]),), x, {"ties": (tie,)}, _stated(first, second))
        return Hidden(((name, f"{first}{'+-'[motor]}{second}"),), x, {"ties": (tie,)})

    return make


def _whole_wrist(m: Planned, rms: float, rng: Rng) -> Hidden:
    """Both motors rub, one more than the other; the size is that of both together."""
    first, second, plus = _pair(m, 1.0)
    minus = _pair(m, -1.0)[2]
    shares = np.array([1.0, float(rng.uniform(0.5, 0.8))])[:: int(rng.choice([-1, 1]))]
    both = sum(s * np.sign(m.qd @ a)[:, None] * a for s, a in zip(shares, (plus, minus), strict=True))
    x = m.amount(np.asarray(both), rms, 10.0)
    levels = (x * shares).tolist()
    ties = tuple(Tie(first, second, sign, level=v) for sign, v in zip((1.0, -1.0), levels, strict=True))
    return Hidden(tuple(("coulomb_friction", a) for a in AXES), x, {"ties": ties}, _stated(first, second))


def _ripple(m: Planned, rms: float, rng: Rng) -> Hidden:
    pitch, rise = float(np.ptp(m.own[0]) / rng.uniform(3.0, 20.0)), float(rng.uniform(0.2, 0.6))
    x = m.amount(slots(m.own[0], pitch, rise), rms, 20.0)
    part = Law(m.name, lambda q, qd: x * float(slots(q, pitch, rise)))
    return Hidden((("torque_ripple", m.name),), x, {"mechanisms": (part,)})


def _nothing(m: Planned, rms: float, rng: Rng) -> Hidden:
    """Half of the models state a wrist all the same."""
    first, second, _ = _pair(m, 1.0)
    return Hidden(axes=_stated(first, second) if rng.random() < 0.5 else {})


def _command_delay(m: Planned, rms: float, rng: Rng) -> Hidden:
    x = m.amount(np.gradient(m.smooth_torque, m.period), rms, 0.025)
    steps = max(round(x / STEP), 1)
    return Hidden((("command_delay", f"tau.{m.name}"),), steps * STEP, {"motor": {m.name: Queue(steps)}})


def _end_stop(m: Planned, rms: float, rng: Rng) -> Hidden:
    """Soft enough that the servo goes on into it."""
    q = m.own[0]
    where = float(np.quantile(q, rng.uniform(0.65, 0.8)))
    x = m.amount(np.maximum(q - where, 0.0), rms, 200.0)
    pushed = replace(m, qdd=m.qdd + np.eye(m.q.shape[1])[m.joint])
    inertia = float(np.mean((pushed.torque() - m.torque())[:, m.joint]))
    stop = Bumper(m.name, where, x, 2.0 * 0.1 * float(np.sqrt(x * inertia)), _mobility(m))
    return Hidden((("end_stop", m.name),), x, {"ties": (stop,)})


def _mobility(m: Planned) -> float:
    model = mujoco.MjModel.from_xml_string(m.arm.mjcf())  # pyright: ignore[reportAttributeAccessIssue]
    return float(model.dof_invweight0[m.joint])


def _two_ripples(m: Planned, rms: float, rng: Rng) -> Hidden:
    """Teeth and slots: each of this size, their pitches no simple ratio of each other."""
    travel, parts = float(np.ptp(m.own[0])), []
    for waves in (rng.uniform(3.0, 7.0), rng.uniform(10.0, 20.0)):
        pitch, rise = travel / float(waves), float(rng.uniform(0.2, 0.6))
        x = m.amount(slots(m.own[0], pitch, rise), rms, 20.0)
        parts.append(Law(m.name, lambda q, qd, x=x, pitch=pitch, rise=rise: x * float(slots(q, pitch, rise))))
    truths = (("torque_ripple", m.name), ("torque_ripple_2", m.name))
    return Hidden(truths, rms, {"mechanisms": tuple(parts)})


def _link(name: str, part: str, axes: tuple[int, ...]) -> Maker:
    def make(m: Planned, rms: float, rng: Rng) -> Hidden:
        link, stiffness, part_of = beam(part, axes)(m, rms, rng)
        return Hidden(((name, link),), stiffness, {"beam": {link: part_of}})

    return make


@dataclass(frozen=True)
class Entry:
    """A mechanism: the effects that the vocabulary needs to have a name for it, and its maker."""

    effects: tuple[str, ...]
    make: Maker

    @property
    def listed(self) -> bool:
        """Whether the vocabulary has them all."""
        try:
            return all(get_effect(name) for name in self.effects)
        except InputError:
            return False


ENTRIES: dict[str, Entry] = {
    "gear_efficiency": Entry(("gear_efficiency",), _gear),
    "motor_saturation": Entry(("motor_saturation",), _motor),
    "heating_friction": Entry(("heating_friction",), _heating(recorded=False)),
    "heating_friction.recorded": Entry(("heating_friction",), _heating(recorded=True)),
    "joint_spring": Entry(("joint_spring",), _joint_spring),
    "wrist.coulomb": Entry(("coulomb_friction",), _wrist("coulomb_friction", "level", np.sign, 10.0)),
    "wrist.viscous": Entry(("viscous_friction",), _wrist("viscous_friction", "viscous", np.asarray, 20.0)),
    "wrist.inertia": Entry(("rotor_inertia",), _wrist("rotor_inertia", "armature", np.asarray, 20.0)),
    "wrist.coulomb.unasked": Entry(
        ("coulomb_friction",), _wrist("coulomb_friction", "level", np.sign, 10.0, stated=False)
    ),
    "wrist.viscous.unasked": Entry(
        ("viscous_friction",), _wrist("viscous_friction", "viscous", np.asarray, 20.0, stated=False)
    ),
    "wrist.inertia.unasked": Entry(
        ("rotor_inertia",), _wrist("rotor_inertia", "armature", np.asarray, 20.0, stated=False)
    ),
    "wrist": Entry(("coulomb_friction",), _whole_wrist),
    "torque_ripple": Entry(("torque_ripple",), _ripple),
    "command_delay": Entry(("command_delay",), _command_delay),
    "end_stop": Entry(("end_stop",), _end_stop),
    "two_ripples": Entry(("torque_ripple", "torque_ripple_2"), _two_ripples),
    "link_torsion": Entry(("link_torsion",), _link("link_torsion", "torsion", (0,))),
    "link_bending": Entry(("link_bending",), _link("link_bending", "bending", (1, 2))),
    "clean": Entry((), _nothing),
}
