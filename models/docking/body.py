"""One free body with the balls, pushed into grooves that stand still: the bench on which the docking is checked."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..compiled import SampleFunction
from ..dormand_prince import DormandPrince
from ..inertia import Array
from ..rotation import quaternion_rate, rotation_of
from .groove import BALLS
from .mechanism import BRISTLES, constants, docked
from .parameters import DockingParameters

_RIGID = 13
_N_HELD = 6 + BALLS + 3 * BALLS


@dataclass(frozen=True, eq=False)
class BodyRun:
    """A motion at n steps.

    Parameters
    ----------
    time : array (n,)
        [s]
    place, quaternion, velocity, spin : array (n, 3), (n, 4), (n, 3), (n, 3)
        Of the body's origin in the grooves' frame, w first; angular velocity in the body's axes [m, m/s, rad/s].
    normal : array (n, 6)
        Forces of the flanks [N].
    off : array (n, 3, 2)
        Of each ball from its seat: axial, lateral [m].
    force, moment : array (n, 3)
        Of the docking on the body, about its origin [N, N·m].
    energy, given, lost : array (n,)
        Kinetic and stored in contacts; work of the wrench, and what damping, friction and latches took, since the
        start [J].
    """

    time: Array
    place: Array
    quaternion: Array
    velocity: Array
    spin: Array
    normal: Array
    off: Array
    force: Array
    moment: Array
    energy: Array
    given: Array
    lost: Array


class DockingBody:
    """A rigid body whose centre of mass is its origin, with the balls of `DockingParameters` on it.

    Parameters
    ----------
    mass : float
        [kg]
    inertia : array (3,)
        Principal moments about its axes [kg·m²].
    tolerance : float
        Relative error of one step, see `DormandPrince`.
    """

    def __init__(self, mass: float, inertia: ArrayLike, tolerance: float = 1e-9) -> None:
        """Write and compile the equations."""
        self._names = list(constants(DockingParameters()))
        t, x = ca.SX.sym("t"), ca.SX.sym("x", _RIGID + BRISTLES + 2)
        u = ca.SX.sym("u", _N_HELD + len(self._names))
        moments = np.asarray(inertia, float)
        rate, seen = self._equations(x, u, float(mass), ca.DM(moments))
        floor = np.concatenate([np.full(3, 1e-2), np.ones(4), np.full(6, 1e-2), np.full(BRISTLES, 1e-4), np.ones(2)])
        self._steps = DormandPrince(ca.Function("rate", [t, x, u], [ca.cse(rate)]), floor, tolerance)
        self._seen = SampleFunction(ca.Function("seen", [x, u], [ca.cse(seen)]))

    def run(
        self,
        parameters: DockingParameters,
        duration: float,
        place: ArrayLike,
        quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0),
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        spin: ArrayLike = (0.0, 0.0, 0.0),
        wrench: ArrayLike = (0.0,) * 6,
        longest: float = 1e-3,
        state: Array | None = None,
    ) -> BodyRun:
        """Move for a duration [s] under a wrench (6,) in the grooves' frame about the body's origin [N, N·m].

        ``state`` goes on where another run ended (its `last`). Steps are at most ``longest`` [s]. Raises StepFault.
        """
        p = constants(parameters)
        held = np.concatenate([np.asarray(wrench, float), np.zeros(4 * BALLS), [p[name] for name in self._names]])
        start = np.concatenate([place, quaternion, velocity, spin, np.zeros(BRISTLES + 2)]) if state is None else state
        steps = self._steps.advance(0.0, start, duration, held, min(1e-4, longest), longest, log=True)
        rows = np.vstack([np.concatenate([[0.0], start]), steps.log])
        states = rows[:, 1:]
        seen = self._seen(states, held)[0][:, :, 0]
        unit = states[:, 3:7] / np.linalg.norm(states[:, 3:7], axis=1, keepdims=True)
        self.last = steps.state
        return BodyRun(
            rows[:, 0], states[:, :3], unit, states[:, 7:10], states[:, 10:13], seen[:, :6],
            seen[:, 6:12].reshape(-1, BALLS, 2), seen[:, 12:15], seen[:, 15:18], seen[:, 18],
            states[:, -2] - start[-2], states[:, -1] - start[-1],
        )  # fmt: skip

    def _equations(self, x: ca.SX, u: ca.SX, mass: float, inertia: ca.DM) -> tuple[ca.SX, ca.SX]:
        place, quaternion, velocity, spin = x[:3], x[3:7], x[7:10], x[10:13]
        push, moment = u[:3], u[3:6]
        p = dict(zip(self._names, ca.vertsplit(u[_N_HELD:]), strict=True))
        turn = rotation_of(quaternion)
        turning = turn @ spin
        found = docked(
            place, turn, velocity, turning, x[_RIGID : _RIGID + BRISTLES], u[6 : 6 + BALLS], u[6 + BALLS : _N_HELD], p
        )
        total = turn.T @ (found.moment + moment)
        rate = ca.vertcat(
            velocity,
            quaternion_rate(quaternion, spin),
            (found.force + push) / mass,
            (total - ca.cross(spin, inertia * spin)) / inertia,
            found.bristle_rate,
            ca.dot(push, velocity) + ca.dot(moment, turning),
            found.damped + found.rubbed + found.latched,
        )
        moving = 0.5 * mass * ca.dot(velocity, velocity) + 0.5 * ca.dot(spin, inertia * spin)
        seen = ca.vertcat(found.normal, ca.vec(found.off.T), found.force, found.moment, moving + found.stored)
        return ca.densify(rate), seen
