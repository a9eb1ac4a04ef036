"""What an arm of the proof can conceal: every effect of the vocabulary that acts on an arm, sized by its torque.

The bench's makers, which the tool was tuned on as kinds of effect (not as cases), and those that the bench has not.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bench.arm import Arm
from bench.concealed import FRICTION, Concealed, Maker, Planned, Rng, TooMuch
from bench.concealed import MAKERS as BENCH
from bench.parts import Drift, Elasticity

from .plant import Law
from .robots import point_inertia

BAND = 15.0
"""Torque above this [Hz] does not count towards an effect's size: disturbances have none either."""


def remainder(torque: NDArray, columns: Sequence[NDArray]) -> NDArray:
    """What a least-squares fit of the columns leaves of a torque (n_samples,)."""
    matrix = np.stack(columns, axis=1)
    return torque - matrix @ np.linalg.lstsq(matrix, torque)[0]


def multiple(torque: NDArray, rms: float, most: float) -> float:
    """Factor that gives a torque (n_samples,) this RMS; refused above ``most``."""
    found = float(rms / np.sqrt(np.mean(torque**2)))
    if found > most:
        raise TooMuch(f"{found:.3g} would be needed, {most:.3g} is the most that hardware has")
    return found


def at_joint(planned: Planned, law: Callable[[float, float, float], float]) -> Law:
    """A law of q and qd of the planned joint alone, as one of all joints."""
    unit = np.eye(len(planned.arm.links))[planned.joint]
    k = planned.joint
    return lambda time, q, qd: unit * law(time, q[k], qd[k])


def _viscous(m: Planned, rms: float, rng: Rng) -> Concealed:
    x = m.amount(m.own[1], rms, 20.0, ("level",))
    return Concealed(m.name, x, replace(m.friction, viscous=x), unknown=("viscous_friction",))


def _quadratic(m: Planned, rms: float, rng: Rng) -> Concealed:
    x = m.amount(np.abs(m.own[1]) * m.own[1], rms, 30.0)
    return Concealed(m.name, x, plant={"laws": (at_joint(m, lambda time, q, qd: -x * qd * abs(qd)),)})


def _makkar(m: Planned, rms: float, rng: Rng) -> Concealed:
    """All of a joint's friction at once: the model has none there."""
    qd = m.own[1]
    top = float(np.abs(qd).max())
    speed, static, viscous = top * rng.uniform(0.04, 0.15), rng.uniform(1.3, 2.0), rng.uniform(0.2, 1.0)
    curve = (1.0 + (static - 1.0) * np.exp(-((qd / speed) ** 2))) * np.sign(qd) + viscous * qd / top
    x = multiple(curve, rms, 10.0)
    law = replace(m.friction, level=x, static=static * x, stribeck_speed=float(speed), viscous=x * viscous / top)
    return Concealed(
        m.name, x, law, unknown=("viscous_friction", "coulomb_friction", "stribeck_friction", "presliding_hysteresis")
    )


def _presliding(m: Planned, rms: float, rng: Rng) -> Concealed:
    """Bristles that bend far enough to show, where the model's friction jumps (Dahl 1968 along the planned motion)."""
    q, qd, _ = m.own
    travel = float(np.ptp(q)) * float(np.exp(rng.uniform(*np.log((0.005, 0.05)))))
    bent = np.zeros(len(q))
    for k, step in enumerate(np.diff(q)):
        # Exact over a step in one direction.
        bent[k + 1] = np.sign(step) + (bent[k] - np.sign(step)) * np.exp(-abs(step) / travel)
    x = m.amount(bent - np.sign(qd), rms, 15.0)
    law = replace(m.friction, level=x, deflection=travel)
    return Concealed(m.name, travel, law, unknown=("presliding_hysteresis",))


def _backlash(m: Planned, rms: float, rng: Rng) -> Concealed:
    """A stiff drive with play; the gap is found by bisection on the torque that the play makes."""
    load = m.torque()
    pushed = replace(m, qdd=m.qdd + np.eye(m.q.shape[1])[m.joint])
    inertia = float(np.mean(pushed.torque()[:, m.joint] - load[:, m.joint]))
    stiffness = (2.0 * np.pi * float(rng.uniform(12.0, 20.0))) ** 2 * inertia
    damping = 2.0 * 0.15 * np.sqrt(stiffness * inertia)
    least, most = 0.0, 0.06

    def size(gap: float) -> float:
        twist = np.zeros_like(m.q)
        twist[:, m.joint] = play(load[:, m.joint], m.period, inertia, stiffness, damping, gap)
        return float(np.sqrt(np.mean(np.square(in_band(load - m.torque(q=m.q - twist), m.period)), axis=0)).max())

    if size(most) < rms or size(1e-5) > rms:
        raise TooMuch("no gap that hardware has is of this size")
    for _ in range(9):
        gap = (least + most) / 2.0
        least, most = (gap, most) if size(gap) < rms else (least, gap)
    spring = Elasticity(float(stiffness), float(damping), gap=most)
    plant = {"armature": {m.name: inertia * float(rng.uniform(0.5, 2.0))}, "elasticity": {m.name: spring}}
    return Concealed(m.name, most, None, plant, (*FRICTION, "rotor_inertia"))


def play(load: NDArray, period: float, inertia: float, stiffness: float, damping: float, gap: float) -> NDArray:
    """Twist x (n_samples,) of a drive with a dead band: inertia·x'' + damping·x' + spring(x) = load."""
    substeps = 4
    h, x, v, found = period / substeps, 0.0, 0.0, np.empty(len(load))
    x = float(np.clip(load[0] / stiffness, -1.0, 1.0)) + float(np.sign(load[0])) * gap / 2.0
    for k, torque in enumerate(load.tolist()):
        found[k] = x
        for _ in range(substeps):
            beyond = x - min(max(x, -gap / 2.0), gap / 2.0)
            v += h * (torque - damping * v - stiffness * beyond) / inertia
            x += h * v
    return found


def in_band(torque: NDArray, period: float) -> NDArray:
    """A torque (n_samples, n_channels) without what lies above `BAND`."""
    spectrum = np.fft.rfft(torque, axis=0)
    spectrum[np.fft.rfftfreq(len(torque), period) > BAND] = 0.0
    return np.fft.irfft(spectrum, len(torque), axis=0)


def _inertia(m: Planned, rms: float, rng: Rng) -> Concealed:
    """Mass spread farther about a link's centre than the model has it: its mass and its centre stay."""
    k = m.joint
    spread = np.diag(rng.uniform(0.05, 1.0, 3))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    added = turn @ (np.trace(spread) * np.eye(3) - spread) @ turn.T
    x = m.amount(m.torque(with_inertia(m.arm, k, added)) - m.torque(), rms, 2.0)
    return Concealed(f"link{k + 1}", x, plant={"real": with_inertia(m.arm, k, x * added)})


def with_inertia(arm: Arm, k: int, added: NDArray) -> Arm:
    """The arm with an inertia (3, 3) added to a link's about its centre of mass."""
    changed = replace(arm.links[k], inertia=arm.links[k].inertia + added)
    return Arm((*arm.links[:k], changed, *arm.links[k + 1 :]))


def with_mass(arm: Arm, k: int, factor: float, mass: float = 0.0, point: NDArray | None = None) -> Arm:
    """The arm with a link's mass and inertia times a factor, and a point mass [kg] at ``point`` [m] added."""
    link = arm.links[k]
    total = factor * link.mass + mass
    point = link.com if point is None else point
    com = (factor * link.mass * link.com + mass * point) / total
    inertia = factor * link.inertia + point_inertia(factor * link.mass, link.com - com)
    changed = replace(link, mass=total, com=com, inertia=inertia + point_inertia(mass, point - com))
    return Arm((*arm.links[:k], changed, *arm.links[k + 1 :]))


def _drift(m: Planned, rms: float, rng: Rng) -> Concealed:
    slow = float(rng.uniform(40.0, 80.0))
    time = m.period * np.arange(len(m.q))
    x = float(rng.choice([-1.0, 1.0])) * m.amount(1.0 - np.exp(-time / slow), rms, 50.0)
    return Concealed(f"tau.{m.name}", x, plant={"tau_drift": {m.name: Drift(x, slow)}})


NOT_YET = ("gear_efficiency", "motor_saturation", "heating_friction", "end_stop", "joint_spring", "command_delay")
"""Effects of an arm that the plant cannot conceal yet: nothing is proved of them."""

MAKERS: dict[str, Maker] = {
    **BENCH,
    "viscous_friction": _viscous,
    "quadratic_friction": _quadratic,
    "makkar_friction": _makkar,
    "presliding_hysteresis": _presliding,
    "backlash": _backlash,
    "inertia_error": _inertia,
    "sensor_drift": _drift,
}
"""By the vocabulary's name. Those missing act on rigs, floating bases and snares, not on an arm."""

VALUES = {
    "coulomb_friction": "level",
    "stribeck_friction": "level",
    "asymmetric_friction": "level_difference",
    "load_dependent_friction": "coefficient",
    "viscous_friction": "coefficient",
    "quadratic_friction": "coefficient",
    "presliding_hysteresis": "travel",
    "rotor_inertia": "inertia",
    "harness_stiffness": "stiffness",
    "joint_elasticity": "stiffness",
    "backlash": "gap",
    "payload_mass": "mass",
    "sensor_bias": "offset",
    "sensor_gain": "error",
    "sensor_delay": "delay",
}
"""The vocabulary's parameter that a maker's value is, but for its sign; of the others the law has other parameters."""

STRUCTURE = ("inertia_error", "payload_mass", "com_offset")
"""What a wrong parameter of the rigid body may be called."""
