"""An arm with carriage, docking and latches, its base floating and its target on that base or floating too: one ODE.

As in `FloatingMotion` the state holds momenta, of base and arm and of a floating target, in the world frame; forces
between the two act in the same points either way, so that their sum is kept to rounding. Bristles, the carriage's
wanted travel and the sums of energies are states as well. The cables' wrenches come in from outside: on the carriage
about its own origin, and on the target about the pin's foot; what else is held during a step stands in `Inputs`.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..compiled import SampleFunction
from ..dormand_prince import DormandPrince, Steps
from ..floating import symbols
from ..floating.arm import FloatingArm
from ..floating.joint_drive import Drive
from ..hanging import hanging_wrench
from ..inertia import Array
from ..rotation import quaternion_of, quaternion_rate, rotation_of
from ..snare.target import Target
from .arm import with_carriage
from .carriage import carriage, reflected_inertia
from .groove import BALLS
from .mechanism import BRISTLES, bumped, constants, docked
from .parameters import DockingParameters

ENERGIES = ("motor", "carriage_lost", "brake", "contact_lost", "latches", "joints", "cables")
"""Sums since the start [J]: the carriage motor's work; lost in screw and carriage; taken by brake and stops; lost in
the docking's contacts; taken by the latches; taken in the joints; work of the cables' wrenches."""
COMMANDS = ("speed", "motor", "brake", "latch_time", "servo")
"""Held during a step: the carriage's speed [m/s]; motor and brake on (1) or off; when the latches began to close [s],
`OPEN` for open; the joints' servo."""
OPEN = 1e9
_PIN, _CARRIER = 13, 13


@dataclass(frozen=True, eq=False)
class Inputs:
    """What is held during a step: wrench on the carriage (6,) and on the pin (6,) in the world [N, N·m]; `COMMANDS`;
    the travel that the brake holds [m]; where the latches took hold (9,) [m]; targets of the joints' servo (J,) [rad].
    """

    carriage: Array
    pin: Array
    commands: Array
    braked: float
    latched: Array
    targets: Array

    def vector(self) -> Array:
        """All of it, (n,)."""
        parts = [self.carriage, self.pin, self.commands, [self.braked], self.latched, self.targets]
        return np.concatenate([np.asarray(part, float) for part in parts])


class DockingMotion:
    """Equations of motion and the steps that follow them.

    Parameters
    ----------
    arm : FloatingArm
        Without the carriage; with a mount where the target is fixed to the base.
    target : Target
        ``free``, hung from a ``spring`` or, on the arm's mount, ``moved``.
    drive : Drive
        Of the arm's joints, for `with_carriage`'s tree.
    parameters : DockingParameters
    tolerance : float
        Relative error of one step, see `DormandPrince`.
    """

    def __init__(
        self, arm: FloatingArm, target: Target, drive: Drive, parameters: DockingParameters, tolerance: float = 1e-8
    ) -> None:
        """Write and compile the equations; raises InputError as `with_carriage` and `Drive` do."""
        self.parameters, self.target = parameters, target
        self.arm = with_carriage(arm, parameters)
        self.bare = arm
        self.n_joints, self.floats = self.arm.n_joints, target.support != "moved"
        self._law = drive.law(self.arm)
        self._names = list(constants(parameters))
        n = self.n_joints
        sizes = {"base": _CARRIER, "q": n, "qd": n, "target": _PIN if self.floats else 0, "bristles": BRISTLES}
        sizes |= {"wanted": 1, "energies": len(ENERGIES)}
        ends = np.cumsum(list(sizes.values()))
        self.where = {name: slice(int(e - s), int(e)) for (name, s), e in zip(sizes.items(), ends, strict=True)}
        self.n_states = int(ends[-1])
        n_given = 12 + len(COMMANDS) + 1 + 3 * BALLS + n
        self._n_given = n_given
        time, x = ca.SX.sym("t"), ca.SX.sym("x", self.n_states)
        u = ca.SX.sym("u", n_given + len(self._names) + len(self._law.start))
        rate, seen = self._equations(time, x, u)
        self._shapes = {name: int(part.numel()) for name, part in seen.items()}
        self._steps = DormandPrince(ca.Function("rate", [time, x, u], [ca.cse(rate)]), self._floor(), tolerance)
        shown = ca.cse(ca.vertcat(*seen.values()))
        self._seen = SampleFunction(ca.Function("seen", [time, x, u], [shown]))

    def values(self, docking: DockingParameters | None = None, joints: dict[str, float] | None = None) -> Array:
        """Constants of docking and joints (n,), to be appended to `Inputs.vector`."""
        p = constants(docking or self.parameters)
        return np.concatenate([[p[name] for name in self._names], list((self._law.start | (joints or {})).values())])

    @property
    def joint_parameters(self) -> dict[str, float]:
        """Parameters of the joints' drive by name, with their values."""
        return dict(self._law.start)

    def start(self, q: ArrayLike, qd: ArrayLike, momentum: ArrayLike) -> Array:
        """A state (n_states,): base at the world's origin, carriage at 0 and at rest, target as `Target` says.

        ``q``, ``qd`` (J − 1,) of the arm's joints; ``momentum`` (6,) of base and arm about the world's origin.
        """
        x = np.zeros(self.n_states)
        x[3], x[7:13] = 1.0, momentum
        x[self.where["q"]][:-1], x[self.where["qd"]][:-1] = q, qd
        if self.floats:
            t = self.target
            turn = np.asarray(ca.DM(ca.evalf(rotation_of(ca.SX(list(t.orientation))))))
            centre = np.asarray(t.position) + turn @ np.asarray(t.centre_of_mass)
            spin = np.asarray(t.angular_velocity)
            linear = t.mass * (np.asarray(t.velocity) + np.cross(spin, turn @ np.asarray(t.centre_of_mass)))
            own = turn @ np.asarray(t.inertia) @ turn.T @ spin
            x[self.where["target"]] = [*t.position, *t.orientation, *linear, *(np.cross(centre, linear) + own)]
        return x

    def advance(self, time: float, state: Array, end: float, size: float, held: Array, log: bool = False) -> Steps:
        """Go from ``time`` to ``end`` [s]; ``held`` is `Inputs.vector` and `values`. Raises StepFault."""
        return self._steps.advance(time, state, end, held, size, log=log)

    def observe(self, time: float, state: Array, held: Array) -> dict[str, Array]:
        """What shows at a state, by name; see `_equations`."""
        row = self._seen(np.array([[time]]), state[None], held)[0][0, :, 0]
        parts = np.split(row, np.cumsum(list(self._shapes.values()))[:-1])
        return dict(zip(self._shapes, parts, strict=True))

    def _floor(self) -> Array:
        mass = float(self.arm.base[0]) + float(self.arm.tree.phi[::10].sum())
        own = {"base": [*np.ones(7), *np.full(6, mass)], "q": np.ones(self.n_joints), "qd": np.ones(self.n_joints)}
        own |= {"target": [*np.ones(7), *np.full(6, self.target.mass)] if self.floats else []}
        own |= {"bristles": np.full(BRISTLES, 1e-2), "wanted": [1.0], "energies": np.full(len(ENERGIES), 1e2)}
        return np.concatenate([np.asarray(own[name], float) for name in self.where])

    def _target(self, x: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
        """Foot, attitude (3, 3), velocity and angular velocity of a floating target, and its kinetic energy."""
        t = self.target
        place, quaternion, linear, angular = x[:3], x[3:7], x[7:10], x[10:13]
        turn = rotation_of(quaternion)
        arm = turn @ ca.DM(list(t.centre_of_mass))
        own = turn.T @ (angular - ca.cross(place + arm, linear))
        spin = ca.solve(ca.SX(ca.DM(np.asarray(t.inertia, float))), own)
        speed = linear / t.mass
        energy = 0.5 * ca.dot(linear, speed) + 0.5 * ca.dot(own, spin)
        turning = turn @ spin
        return place, turn, speed - ca.cross(turning, arm), turning, energy

    def _equations(self, time: ca.SX, x: ca.SX, u: ca.SX) -> tuple[ca.SX, dict[str, ca.SX]]:
        arm, n = self.arm, self.n_joints
        part = {name: x[where] for name, where in self.where.items()}
        suspended, cradled = ca.SX(0), ca.SX(0)
        q, qd = part["q"], part["qd"]
        on_carriage, on_pin = u[:6], u[6:12]
        command = dict(zip(COMMANDS, ca.vertsplit(u[12 : 12 + len(COMMANDS)]), strict=True))
        first = 12 + len(COMMANDS)
        braked, latched_at = u[first], u[first + 1 : first + 1 + 3 * BALLS]
        targets = u[first + 1 + 3 * BALLS : self._n_given]
        p = dict(zip(self._names, ca.vertsplit(u[self._n_given : self._n_given + len(self._names)]), strict=True))
        values = u[self._n_given + len(self._names) :]

        base = part["base"]
        position, quaternion, linear, angular = base[:3], base[3:7], base[7:10], base[10:13]
        rotation = rotation_of(quaternion)
        whole, tip = symbols.inertia(arm, q), symbols.tip(arm, q)
        own = ca.vertcat(rotation.T @ linear, rotation.T @ (angular - ca.cross(position, linear)))
        h_b, h_bm, h_m = whole[:6, :6], whole[:6, 6:], whole[6:, 6:]
        root = ca.chol(h_b).T
        half = ca.solve(root, h_bm)
        twist = ca.solve(root.T, ca.solve(root, own) - half @ qd)
        world_twist = _turned(rotation, twist)

        tip_twist = _turned(rotation, tip.by_base @ twist + tip.by_joints @ qd)
        tip_place, tip_turn = position + rotation @ tip.translation, rotation @ tip.rotation
        # The carriage slides along −x of the tip's frame.
        slide = -tip.rotation[:, 0]
        carried = tip.translation + q[n - 1] * slide
        by_joints = ca.SX(tip.by_joints)
        by_joints[:3, :] = tip.by_joints[:3, :] - ca.skew(carried - tip.translation) @ tip.by_joints[3:, :]
        by_joints[:3, n - 1] = slide
        carried_by_base = symbols.by_base(carried)
        carriage_place = position + rotation @ carried
        carriage_twist = _turned(rotation, carried_by_base @ twist + by_joints @ qd)

        if self.floats:
            foot, turn, speed, spin, target_energy = self._target(part["target"])
        else:
            assert arm.mount is not None
            mount_turn, mount_place = (ca.DM(a) for a in arm.mount)
            moved = _turned(rotation, symbols.by_base(mount_place) @ twist)
            foot, turn = position + rotation @ mount_place, rotation @ mount_turn
            speed, spin, target_energy = moved[:3], moved[3:], ca.SX(0)

        gone = tip_place - foot
        seen_speed = tip_twist[:3] - speed - ca.cross(spin, gone)
        engaged = ca.fmin(ca.fmax((time - command["latch_time"]) / p["latch_time"], 0.0), 1.0)
        found = docked(
            turn.T @ gone, turn.T @ tip_turn, turn.T @ seen_speed, turn.T @ (tip_twist[3:] - spin),
            part["bristles"], ca.repmat(engaged, BALLS, 1), latched_at, p,
        )  # fmt: skip
        on_tip = ca.vertcat(turn @ found.force, turn @ found.moment)
        bump, bump_moment, bump_stored, bump_damped = bumped(
            turn.T @ gone,
            turn.T @ tip_turn,
            turn.T @ seen_speed,
            turn.T @ (tip_twist[3:] - spin),
            q[n - 1],
            qd[n - 1],
            p,
        )
        bumps = ca.vertcat(turn @ bump, turn @ bump_moment)
        on_foot = -ca.vertcat(on_tip[:3], on_tip[3:] + ca.cross(gone, on_tip[:3])) + on_pin
        on_foot -= ca.vertcat(bumps[:3], bumps[3:] + ca.cross(carriage_place - foot, bumps[:3]))
        cables, on_carriage = on_carriage, on_carriage + bumps
        if self.target.hangs:
            held, suspended, cradled = hanging_wrench(self.target, foot, turn, spin)
            on_foot += held

        drawn = carriage(
            q[n - 1], qd[n - 1], part["wanted"], command["speed"], command["motor"], command["brake"], braked, p
        )
        bias = symbols.bias(arm, q, twist, qd, ca.SX(3, 1))
        taken = self._law.expression(time, q, qd, ca.SX(0, 1), ca.diag(h_m), targets, command["servo"], values)
        at_tip, at_carriage = _turned(rotation.T, on_tip), _turned(rotation.T, on_carriage)
        torque = ca.SX(taken.torque)
        torque[n - 1] += drawn.force
        pull = torque - bias[6:] + tip.by_joints.T @ at_tip + by_joints.T @ at_carriage
        matrix = h_m + ca.diag(taken.inertia)
        matrix[n - 1, n - 1] += reflected_inertia(self.parameters)
        on_base = tip.by_base.T @ at_tip + carried_by_base.T @ at_carriage
        pushed = on_tip[:3] + on_carriage[:3]
        moment = ca.cross(tip_place, on_tip[:3]) + on_tip[3:]
        moment += ca.cross(carriage_place, on_carriage[:3]) + on_carriage[3:]
        if not self.floats:
            on_base += symbols.by_base(mount_place).T @ _turned(rotation.T, on_foot)
            # What the docking does between tip and mount leaves their sum: only the cables' part is added.
            pushed = cables[:3] + on_pin[:3]
            moment = ca.cross(carriage_place, cables[:3]) + cables[3:]
            moment += ca.cross(foot, on_pin[:3]) + on_pin[3:]
        pull -= half.T @ ca.solve(root, on_base - bias[:6])
        matrix -= half.T @ half
        lower = ca.chol(matrix).T
        qdd = ca.solve(lower.T, ca.solve(lower, pull))

        rates = [world_twist[:3], quaternion_rate(quaternion, twist[3:]), pushed, moment, qd, qdd]
        if self.floats:
            rates += [
                speed,
                quaternion_rate(part["target"][3:7], turn.T @ spin),
                on_foot[:3],
                ca.cross(foot, on_foot[:3]) + on_foot[3:],
            ]
        work = ca.dot(cables, carriage_twist) + ca.dot(on_pin, ca.vertcat(speed, spin))
        energies = [
            drawn.put_in, drawn.lost, drawn.held, found.damped + found.rubbed + bump_damped + cradled, found.latched,
            -ca.dot(taken.torque, qd), work,
        ]  # fmt: skip
        rates += [
            found.bristle_rate,
            command["motor"] * command["speed"] + (1 - command["motor"]) * qd[n - 1],
            *energies,
        ]

        moving = ca.vertcat(twist, qd)
        inside = whole[:6, :] @ moving
        total = rotation @ inside[:3]
        rotors = 0.5 * (ca.dot(taken.inertia, qd * qd) + reflected_inertia(self.parameters) * qd[n - 1] ** 2)
        cable = _turned(
            tip_turn.T,
            ca.vertcat(on_carriage[:3], on_carriage[3:] + ca.cross(carriage_place - tip_place, on_carriage[:3])),
        )
        seen = {
            "tip": _frame(tip_place, tip_turn, tip_twist),
            "base": _frame(position, rotation, world_twist),
            "carriage": _frame(carriage_place, tip_turn, carriage_twist),
            "pin": _frame(foot, turn, ca.vertcat(speed, spin)),
            "momentum": ca.vertcat(total, rotation @ inside[3:] + ca.cross(position, total)),
            "target_momentum": part["target"][7:] if self.floats else ca.SX(6, 1),
            "normal": found.normal,
            "off": ca.vec(found.off.T),
            "docking": _turned(tip_turn.T, on_tip),
            "wrist": _turned(tip_turn.T, on_tip) + cable,
            "motor_force": drawn.motor,
            "engaged": engaged,
            "kinetic": 0.5 * ca.dot(moving, whole @ moving) + rotors + target_energy,
            "bumper": -bump[0],
            "stored": found.stored + bump_stored,
            "suspension": suspended,
            "balls": ca.vec(ca.horzcat(*_ball_places(turn.T @ gone, turn.T @ tip_turn, p))),
        }
        return ca.densify(ca.vertcat(*rates)), {name: ca.densify(ca.SX(value)) for name, value in seen.items()}


def _ball_places(place: ca.SX, turn: ca.SX, p: dict[str, ca.SX]) -> list[ca.SX]:
    """Centres of the balls in the target's frame (3,) each [m]."""
    from .groove import axes

    return [place + turn @ (p["seat"] * ca.DM(axes(i)[0]) + p["radius"] * ca.DM(axes(i)[2])) for i in range(BALLS)]


def _frame(place: ca.SX, turn: ca.SX, twist: ca.SX) -> ca.SX:
    """Position, quaternion, velocity and angular velocity (13,)."""
    return ca.vertcat(place, quaternion_of(turn), twist)


def _turned(rotation: ca.SX, pair: ca.SX) -> ca.SX:
    return ca.vertcat(rotation @ pair[:3], rotation @ pair[3:])
