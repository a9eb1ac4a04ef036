"""Motion of an arm on a floating base, its joints servoed or passive, with registered effects in the joints.

The state holds the **momentum** of base and arm in the world frame instead of the base's velocity. Without forces it is
then constant whatever the step, and the base's twist follows from it: (v, w) = H_b^-1 (momentum - H_bm qd). Joint
accelerations come from the rest of the equations of motion (`symbols`), with the base's eliminated::

    (H_m - H_bm^T H_b^-1 H_bm + B) qdd = tau - c_m + J_m^T f - H_bm^T H_b^-1 (J_b^T f - c_b)

tau is the motor's torque less what the effects take, B what they take per acceleration (a rotor's inertia), and f the
wrench at the tip. Another wrench may act at the arm's mount, a frame fixed to the base: it adds to the base's rows.
Everything is one CasADi expression, run in C: Drake calls a force written in Python so slowly (about 0.5 ms) that
friction from the registry would cost a hundred times the arm. Drake is the check.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from ..compiled import SampleFunction
from ..dormand_prince import DormandPrince, Steps
from ..inertia import Array
from ..rotation import quaternion_of, quaternion_rate, rotation_of
from . import symbols
from .arm import FloatingArm
from .joint_drive import Drive

_BASE_STATES = 13  # position, quaternion, linear and angular momentum


@dataclass(frozen=True, eq=False)
class Observation:
    """What shows of a motion; n states in, all in the world frame, linear before angular.

    Parameters
    ----------
    base_position, base_quaternion : array (n, 3), (n, 4)
        [m; w, x, y, z]
    base_twist : array (n, 6)
        Of the base frame's origin [m/s, rad/s].
    tip_position, tip_quaternion : array (n, 3), (n, 4)
    tip_twist : array (n, 6)
    mount_position, mount_quaternion, mount_twist : array (n, 3), (n, 4), (n, 6)
        Of the arm's mount; of the base's frame where it has none.
    momentum : array (n, 6)
        Linear [N·s], and angular about the world's origin [N·m·s].
    energy : array (n,)
        Kinetic energy of base and arm [J], that of rotors left out.
    """

    base_position: Array
    base_quaternion: Array
    base_twist: Array
    tip_position: Array
    tip_quaternion: Array
    tip_twist: Array
    mount_position: Array
    mount_quaternion: Array
    mount_twist: Array
    momentum: Array
    energy: Array


class FloatingMotion:
    """Equations of motion of an arm and the steps that follow them.

    Inputs (6 + J,): wrench at the tip in the world frame [N, N·m], then the servo's target [rad or m]; held, or moving
    along a parabola. An arm with a mount has six more, the wrench there about the mount's origin, behind the tip's.
    State: base position, quaternion, linear and angular momentum (13, on a floating base only), then q, qd, and the
    effects' hidden states.

    Parameters
    ----------
    arm : FloatingArm
    drive : Drive
        The servo's gains and the effects in the joints.
    tolerance : float
        Relative error of one step, see `DormandPrince`.
    """

    def __init__(self, arm: FloatingArm, drive: Drive | None = None, tolerance: float = 1e-8) -> None:
        """Write and compile the equations; raises InputError as `Drive` does."""
        self.arm, self.drive = arm, drive or Drive()
        self._law = self.drive.law(arm)
        self.n_base = _BASE_STATES if arm.floating else 0
        n_joints = arm.n_joints
        self.n_states = self.n_base + 2 * n_joints + self._law.n_states
        self.n_wrenches = 6 if arm.mount is None else 12
        self.n_inputs = self.n_wrenches + n_joints
        self._n_held = 1 + 3 * self.n_inputs + 1 + len(self._law.start)
        time, x, u = ca.SX.sym("t"), ca.SX.sym("x", self.n_states), ca.SX.sym("u", self._n_held)
        rate, observed = self._equations(time, x, u)
        self._steps = DormandPrince(ca.Function("rate", [time, x, u], [ca.cse(rate)]), self._floor(), tolerance)
        self._observed = SampleFunction(ca.Function("observed", [x], [ca.cse(ca.vertcat(*observed))]))

    @property
    def parameters(self) -> dict[str, float]:
        """Gains and effects' parameters by name, with their values."""
        return dict(self._law.start)

    @property
    def units(self) -> dict[str, str]:
        """Units of the `parameters`, in pint's spelling."""
        return dict(self._law.units)

    def check(self, values: Mapping[str, float]) -> None:
        """Refuse values of parameters that are unknown, not finite, or out of their bounds."""
        self.drive.check(self.arm, self._law.start, values)

    def start(
        self,
        q: ArrayLike | None = None,
        qd: ArrayLike | None = None,
        position: ArrayLike = (0.0, 0.0, 0.0),
        quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0),
        momentum: ArrayLike = (0.0,) * 6,
    ) -> Array:
        """A state (n_states,): joints (none: at zero and rest), and on a floating base its pose and the momentum."""
        n_joints, name = self.arm.n_joints, self.arm.tree.name
        joints = []
        for word, value in (("q", q), ("qd", qd)):
            array = np.zeros(n_joints) if value is None else np.asarray(value, float)
            if array.shape != (n_joints,) or not np.isfinite(array).all():
                raise InputError(f"{name}: {word} is {array.tolist()}; give {n_joints} finite numbers, one per joint")
            joints.append(array)
        if not self.arm.floating:
            return np.concatenate([*joints, np.zeros(self._law.n_states)])
        parts = [np.asarray(value, float) for value in (position, quaternion, momentum)]
        if [part.shape for part in parts] != [(3,), (4,), (6,)] or not np.isfinite(np.concatenate(parts)).all():
            raise InputError(
                f"{name}: base {[p.tolist() for p in parts]}; give position, quaternion, momentum: 3, 4, 6"
            )
        if not parts[1].any():
            raise InputError(f"{name}: the base's quaternion is zero; give one of length 1")
        base = np.concatenate([parts[0], parts[1] / np.linalg.norm(parts[1]), parts[2]])
        return np.concatenate([base, *joints, np.zeros(self._law.n_states)])

    def advance(
        self,
        time: float,
        state: Array,
        end: float,
        size: float = 1e-3,
        inputs: ArrayLike | None = None,
        rates: ArrayLike | None = None,
        servo: bool = True,
        values: Mapping[str, float] | None = None,
        longest: float = np.inf,
        log: bool = False,
    ) -> Steps:
        """Go from ``time`` to ``end`` [s] in steps of at most ``longest`` [s], ``size`` [s] being the first to try.

        Parameters
        ----------
        inputs : array (n_inputs,) or None
            Wrenches and target at ``time``; None: zero.
        rates : array (2, n_inputs) or None
            Their first and second derivatives by time; None: zero.
        servo : bool
            False turns the motors off: only the effects act in the joints.
        values : mapping of str to float
            Stand in for `parameters`.
        log : bool
            Whether to hand back each step.
        """
        held = np.zeros(self._n_held)
        n, held[0] = self.n_inputs, time
        for name, given, place in (("inputs", inputs, slice(1, 1 + n)), ("rates", rates, slice(1 + n, 1 + 3 * n))):
            if given is not None:
                array = np.ravel(given)
                if array.size != place.stop - place.start:
                    raise InputError(
                        f"{self.arm.tree.name}: {array.size} {name} given; give {place.stop - place.start}: "
                        f"{self.n_wrenches} of the wrench, then the joints' targets"
                    )
                held[place] = array
        held[1 + 3 * n] = float(servo)
        held[2 + 3 * n :] = list(({**self._law.start, **values} if values else self._law.start).values())
        return self._steps.advance(time, state, end, held, size, longest, log)

    def observe(self, states: Array) -> Observation:
        """What shows at states (n, n_states)."""
        rows = self._observed(np.atleast_2d(states))[0][:, :, 0]
        parts = np.split(rows, np.cumsum([3, 4, 6, 3, 4, 6, 3, 4, 6, 6]), axis=1)
        parts[-1] = parts[-1][:, 0]
        return Observation(*parts)

    def joints(self, states: Array) -> tuple[Array, Array]:
        """Joint positions and rates, each (n, J), of states (n, n_states)."""
        first, n_joints = self.n_base, self.arm.n_joints
        return states[:, first : first + n_joints], states[:, first + n_joints : first + 2 * n_joints]

    def _floor(self) -> Array:
        """An error is relative to the state's size plus 1 m, rad, m/s; momentum plus that of the whole mass at 1 m/s.

        Momentum has no error of its own to speak of: it changes by the wrench alone.
        """
        mass = float(self.arm.base[0]) + float(self.arm.tree.phi[::10].sum())
        base = np.concatenate([np.ones(7), np.full(6, mass)]) if self.arm.floating else np.empty(0)
        return np.concatenate([base, np.ones(2 * self.arm.n_joints + self._law.n_states)])

    def _equations(self, time: ca.SX, x: ca.SX, u: ca.SX) -> tuple[ca.SX, list[ca.SX]]:
        arm, n_joints = self.arm, self.arm.n_joints
        joints = x[self.n_base :]
        q, qd, hidden = joints[:n_joints], joints[n_joints : 2 * n_joints], joints[2 * n_joints :]
        passed, n = time - u[0], self.n_inputs
        now = u[1 : 1 + n] + passed * (u[1 + n : 1 + 2 * n] + 0.5 * passed * u[1 + 2 * n : 1 + 3 * n])
        wrench, target, on, values = now[:6], now[self.n_wrenches :], u[1 + 3 * n], u[2 + 3 * n :]
        whole, tip = symbols.inertia(arm, q), symbols.tip(arm, q)
        mount_turn, mount_place = (ca.DM(part) for part in arm.mount or (np.eye(3), np.zeros(3)))
        h_b, h_bm, h_m = whole[:6, :6], whole[:6, 6:], whole[6:, 6:]
        if arm.floating:
            position, quaternion, linear, angular = x[:3], x[3:7], x[7:10], x[10:13]
            rotation = rotation_of(quaternion)
            own = ca.vertcat(rotation.T @ linear, rotation.T @ (angular - ca.cross(position, linear)))
            root = ca.chol(h_b).T
            half = ca.solve(root, h_bm)
            twist = ca.solve(root.T, ca.solve(root, own) - half @ qd)
        else:
            position, quaternion, rotation = ca.SX(3, 1), ca.SX([1, 0, 0, 0]), ca.SX.eye(3)
            twist = ca.SX(6, 1)
        bias = symbols.bias(arm, q, twist, qd, ca.SX(ca.DM(arm.tree.gravity)))
        taken = self._law.expression(time, q, qd, hidden, ca.diag(h_m), target, on, values)
        force = _turned(rotation.T, wrench)
        pull = taken.torque - bias[6:] + tip.by_joints.T @ force
        matrix = h_m + ca.diag(taken.inertia)
        if arm.floating:
            at_mount = now[6:12] if arm.mount else ca.SX(6, 1)
            on_base = tip.by_base.T @ force + symbols.by_base(mount_place).T @ _turned(rotation.T, at_mount)
            pull -= half.T @ ca.solve(root, on_base - bias[:6])
            matrix -= half.T @ half
        lower = ca.chol(matrix).T
        qdd = ca.solve(lower.T, ca.solve(lower, pull))
        rates = [qd, qdd, taken.rate]
        place = position + rotation @ tip.translation
        if arm.floating:
            moment = ca.cross(place, wrench[:3]) + wrench[3:]
            moment += ca.cross(position + rotation @ mount_place, at_mount[:3]) + at_mount[3:]
            pushed = wrench[:3] + at_mount[:3]
            base = [rotation @ twist[:3], quaternion_rate(quaternion, twist[3:]), pushed, moment]
            rates = [*base, *rates]
        tip_twist = tip.by_base @ twist + tip.by_joints @ qd
        moving = ca.vertcat(twist, qd)
        inside = whole[:6, :] @ moving
        total_linear = rotation @ inside[:3]
        observed = [
            position,
            quaternion / ca.norm_2(quaternion),
            _turned(rotation, twist),
            place,
            quaternion_of(rotation @ tip.rotation),
            _turned(rotation, tip_twist),
            position + rotation @ mount_place,
            quaternion_of(rotation @ mount_turn),
            _turned(rotation, symbols.by_base(mount_place) @ twist),
            total_linear,
            rotation @ inside[3:] + ca.cross(position, total_linear),
            0.5 * ca.dot(moving, whole @ moving),
        ]
        return ca.densify(ca.vertcat(*rates)), observed


def _turned(rotation: ca.SX, pair: ca.SX) -> ca.SX:
    return ca.vertcat(rotation @ pair[:3], rotation @ pair[3:])
