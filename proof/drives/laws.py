"""Torques that resist a joint, in compiled code: the friction that every joint has, and what a case may conceal.

Every law is written as hardware catalogues and textbooks on drives write it, not as the tool's vocabulary does: the
direction of friction is the state of bristles or of slipping elements, and curves are tables where they can be.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .compiled import compiled

DAHL, SLIP, LAGGING = 0, 1, 2
"""Kinds of presliding: Dahl (1968); four elements in parallel that slip one after another (Iwan 1966); Dahl's with a
travel that grows with speed, so that friction lags fast reversals (Hess and Soom 1990)."""

THRESHOLDS = np.array([0.3, 0.8, 1.5, 2.6])
"""Travels at which the slipping elements let go, as multiples of the joint's own."""

(
    FILM,
    ONE_WAY,
    MESH,
    ECCENTRIC,
    CHURNING,
    COGGING,
    CABLE,
    TWO_ANGLES,
    TWO_SPEEDS,
    DRIVING,
    WARMING,
    TOOTH,
    DETENT,
    SEAL,
    IRON,
    CUT_OFF,
    CHATTER,
) = range(17)
"""Laws by number; what each means stands in `torque`."""

TABLE = 256


class Friction(NamedTuple):
    """Friction of every joint, arrays (n,): ``kind``, ``level`` [N·m], ``viscous`` [N·m·s/rad], ``travel`` [rad] over
    which it builds up, ``lag`` [rad/s], the speed that doubles the travel of a lagging joint.
    """

    kind: NDArray
    level: NDArray
    viscous: NDArray
    travel: NDArray
    lag: NDArray


class Laws(NamedTuple):
    """Laws that act besides, arrays (n_laws,), ``number`` (FILM to CHATTER), ``joint``, ``other`` (a joint too),
    ``size``; ``numbers`` (n_laws, 6) and ``table`` (n_laws, 256), as `torque` says.
    """

    number: NDArray
    joint: NDArray
    other: NDArray
    size: NDArray
    numbers: NDArray
    table: NDArray


@compiled
def slid(kind, state, move, speed, travel, lag, after):
    """Direction of friction, -1 to 1, amid a ``move`` [rad]; the elements' states go from state to after."""
    if kind == SLIP:
        direction = 0.0
        for k in range(4):
            most = THRESHOLDS[k]
            after[k] = min(max(state[k] + move / travel, -most), most)
            direction += 0.125 * (state[k] + after[k]) / most
        return direction
    reach = travel * (1.0 + abs(speed) / lag) if kind == LAGGING else travel
    sign = 1.0 if move >= 0.0 else -1.0
    after[0] = sign + (state[0] - sign) * np.exp(-abs(move) / reach)
    return 0.5 * (state[0] + after[0])


@compiled
def looked_up(table, turns):
    """A periodic table at a number of ``turns``, between its entries by a line."""
    x = (turns - np.floor(turns)) * TABLE
    k = int(x)
    part = x - k
    return table[k % TABLE] * (1.0 - part) + table[(k + 1) % TABLE] * part


@compiled
def torque(number, p, table, time, q, qd, direction, load, motor, q2, qd2, state):
    """Resisting torque of a law of size 1 but for `CUT_OFF`, where nothing is linear in a size [N·m].

    ``direction``: of the joint's friction, -1 to 1. ``load``: torque that the gear carries to the link. ``motor``: what
    the current should give. ``q2``, ``qd2``: of the other joint. ``state``: of `WARMING` (heat, 0 to 1) and `DETENT`.
    """
    if number == FILM:  # p: speed, shape. Extra friction that a lubricant film takes off
        x = abs(qd) / p[0]
        if p[1] == 0.0:
            return direction / (1.0 + x * x)
        if p[1] == 1.0:
            return direction / np.cosh(x)
        return direction * np.exp(-x)
    if number == ONE_WAY:  # more in the positive direction
        return max(direction, 0.0)
    if number == MESH:  # teeth rub with what they carry
        return direction * abs(load)
    if number == ECCENTRIC:  # p: period, phase in turns. A level that runs with position
        return direction * looked_up(table, q / p[0] + p[1])
    if number == CHURNING:  # p: exponent
        return np.sign(qd) * abs(qd) ** p[0]
    if number == COGGING:  # p: period, phase in turns
        return looked_up(table, q / p[0] + p[1])
    if number == CABLE:  # p: rest, hardening per rad². A bundle that grows stiffer
        x = q - p[0]
        return x + p[1] * x * x * x
    if number == TWO_ANGLES:  # p: waves per rad, phase. A hose over two joints
        return np.sin(p[0] * q2 + p[1]) * np.cos(q + p[2])
    if number == TWO_SPEEDS:  # bevels of a wrist: one joint's teeth are pressed by the other's motion
        return direction * abs(qd2)
    if number == DRIVING:  # p: torque and speed over which the quadrants change. A worm: only driving costs
        return 0.5 * (1.0 + np.tanh(load / p[0] * qd / p[1])) * direction * abs(load)
    if number == WARMING:  # friction goes as grease warms
        return -direction * state
    if number == TOOTH:  # p: middle, width, waves per rad. One damaged tooth
        x = (q - p[0]) / p[1]
        return np.exp(-x * x) * np.sin(p[2] * (q - p[0]))
    if number == DETENT:  # p: width [rad], poles per rad, phase, share of detent. Magnets that lag and hold
        return state / p[0] + p[3] * np.sin(p[1] * q + p[2])
    if number == SEAL:  # p: low, high, edge. A lip that grips on the way out of one stretch
        inside = 0.25 * (1.0 + np.tanh((q - p[0]) / p[2])) * (1.0 + np.tanh((p[1] - q) / p[2]))
        return inside * max(direction, 0.0)
    if number in (IRON, CUT_OFF):  # p: knee. Above it a motor gives less for each ampere; or no more than a limit
        return np.sign(motor) * max(abs(motor) - p[0], 0.0)
    # CHATTER. p: frequency [Hz], speed, width. A resonance that one range of speeds wakes
    x = (abs(qd) - p[1]) / p[2]
    return np.exp(-x * x) * np.sin(2.0 * np.pi * p[0] * time)


@compiled
def went(number, p, state, period, move, qd, direction):
    """State of a law one ``period`` [s] and one ``move`` [rad] later."""
    if number == WARMING:  # p: time constant [s], speed that warms fully
        warm = min(abs(qd * direction) / p[1], 1.0)
        return warm + (state - warm) * np.exp(-period / p[0])
    if number == DETENT:
        return min(max(state + move, -p[0]), p[0])
    return state


@compiled
def directions(kind, travel, lag, period, q, qd):
    """Direction of friction (n_samples,) along a joint's planned motion."""
    state, after, found = np.zeros(4), np.zeros(4), np.zeros(q.size)
    for k in range(1, q.size):
        slid(kind, state, q[k] - q[k - 1], qd[k], travel, lag, after)
        state[:] = after
        found[k] = np.sum(0.25 * state / THRESHOLDS) if kind == SLIP else state[0]
    return found


@compiled
def along(number, p, table, period, q, qd, direction, load, motor, q2, qd2):
    """`torque` (n_samples,) along a planned motion."""
    found, state = np.zeros(q.size), 0.0
    for k in range(q.size):
        move = q[k] - q[k - 1] if k else 0.0
        state = went(number, p, state, period, move, qd[k], direction[k])
        found[k] = torque(
            number, p, table, k * period, q[k], qd[k], direction[k], load[k], motor[k], q2[k], qd2[k], state
        )
    return found
