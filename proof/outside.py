"""Physics that no name of the vocabulary stands for: the honest answer is ``unknown_effect``.

Each is sized by what is left of its torque after a fit of the named laws that come nearest: level, viscous, quadratic
and load-dependent friction, rotor inertia, harness, bias and drift at its joint. So none is a name in disguise.
"""

import numpy as np

from bench.concealed import Concealed, Maker, Planned, Rng

from .concealed import at_joint, multiple, remainder

SMOOTH = 0.03
"""Speed over which these laws' friction turns round [rad/s]: MuJoCo steps through it without bristles."""


def sized(m: Planned, torque: np.ndarray, rms: float, most: float) -> float:
    """Multiple of a torque (n_samples,) of which the nearest named laws leave this RMS; refused above ``most``."""
    q, qd, qdd = m.own
    time = m.period * np.arange(len(q))
    sign, load = np.sign(qd), np.abs(m.torque()[:, m.joint])
    near = [np.ones_like(q), time, q, qd, qdd, sign, qd * np.abs(qd), load * sign]
    return multiple(remainder(torque, near), rms, most)


def _running_time(m: Planned, rms: float, rng: Rng) -> Concealed:
    """A seal that swells as it warms: its friction grows with the time since the start."""
    slow = float(rng.uniform(4.0, 12.0))
    time = m.period * np.arange(len(m.q))
    x = sized(m, (1.0 - np.exp(-time / slow)) * np.sign(m.own[1]), rms, 8.0)

    def law(t, q, qd):
        return -x * (1.0 - np.exp(-max(t, 0.0) / slow)) * np.tanh(qd / SMOOTH)

    return Concealed(m.name, x, plant={"laws": (at_joint(m, law),)})


def _damaged_tooth(m: Planned, rms: float, rng: Rng) -> Concealed:
    """A few waves of torque at one place of the travel, and none elsewhere."""
    q = m.own[0]
    wide = float(np.ptp(q)) * float(rng.uniform(0.05, 0.1))
    middle, cycles = float(np.quantile(q, rng.uniform(0.3, 0.7))), float(rng.uniform(1.0, 2.0)) * 2.0 * np.pi / wide

    def shape(q):
        return np.exp(-(((q - middle) / wide) ** 2)) * np.sin(cycles * (q - middle))

    x = sized(m, shape(q), rms, 25.0)
    return Concealed(m.name, x, plant={"laws": (at_joint(m, lambda t, q, qd: x * shape(q)),)})


def _bursts(m: Planned, rms: float, rng: Rng) -> Concealed:
    """Something that shakes now and then: bursts of one frequency that no state of the arm goes with."""
    length = m.period * len(m.q)
    frequency, count = float(rng.uniform(2.0, 6.0)), 3
    # In each third once, so that the shorter held-out recording has a burst too.
    starts = (np.arange(count) + rng.uniform(0.1, 0.6, count)) * length / count
    phases = rng.uniform(0.0, 2.0 * np.pi, count)

    def shape(t):
        parts = [np.exp(-(((t - s) / 0.8) ** 2)) * np.sin(2.0 * np.pi * frequency * (t - s) + p) for s, p in waves]
        return np.sum(parts, axis=0)

    waves = list(zip(starts.tolist(), phases.tolist(), strict=True))
    x = sized(m, shape(m.period * np.arange(len(m.q))), rms, 25.0)
    return Concealed(m.name, x, plant={"laws": (at_joint(m, lambda t, q, qd: x * float(shape(t))),)})


def _hardening(m: Planned, rms: float, rng: Rng) -> Concealed:
    """A cable bundle that goes stiff near the end of the travel: a spring of the fifth power."""
    x = sized(m, m.own[0] ** 5, rms, 300.0)
    return Concealed(m.name, x, plant={"laws": (at_joint(m, lambda t, q, qd: -x * q**5),)})


def _seal(m: Planned, rms: float, rng: Rng) -> Concealed:
    """A lip seal that sticks over one stretch of the travel, on the way out only."""
    q, qd, _ = m.own
    low = float(np.quantile(q, rng.uniform(0.3, 0.5)))
    high, edge = low + float(np.ptp(q)) * float(rng.uniform(0.15, 0.25)), 0.02

    def shape(q, qd):
        inside = 0.25 * (1.0 + np.tanh((q - low) / edge)) * (1.0 + np.tanh((high - q) / edge))
        return inside * np.maximum(np.tanh(qd / SMOOTH), 0.0)

    x = sized(m, shape(q, qd), rms, 8.0)
    return Concealed(m.name, x, plant={"laws": (at_joint(m, lambda t, q, qd: -x * shape(q, qd)),)})


def _shared_cable(m: Planned, rms: float, rng: Rng) -> Concealed:
    """A cable over two joints that pulls on one by the other's position: a joint's torque that its own state lacks."""
    other = (m.joint + 1) % len(m.arm.links)
    q = m.q[:, other]
    x = sized(m, np.sin(2.0 * q) * np.cos(m.own[0]), rms, 25.0)
    unit, k = np.eye(len(m.arm.links))[m.joint], m.joint

    def law(t, q, qd):
        return -x * unit * np.sin(2.0 * q[other]) * np.cos(q[k])

    return Concealed(m.name, x, plant={"laws": (law,)})


OUTSIDE: dict[str, Maker] = {
    "friction that grows with running time": _running_time,
    "damaged tooth": _damaged_tooth,
    "bursts of vibration": _bursts,
    "hardening cable": _hardening,
    "one-way seal": _seal,
    "cable over two joints": _shared_cable,
}
