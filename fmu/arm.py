"""An arm that moves as its drives push it: forward dynamics with every effect of a model file.

Accelerations a (of a floating base, then of the J links) solve, with M the inertia, c the velocity and gravity terms
less what acts from outside, and ``load = M a + c`` the rigid-body torque::

    base:          (M a + c)_base = 0
    rigid joint:   load_j + friction_j(q, qd, qdd_j, load_j) = tau_j
    springy joint: load_j = spring_j,   friction_j(q, qd, qdd_motor, spring_j) + spring_j = tau_j

by Newton's method with the symmetric matrix ``M + diag((d friction / d qdd) / (1 + d friction / d load))``; one step is
exact where friction is linear in acceleration and load (Featherstone 2008, chapters 6 and 8, for M, c and M's factors).
At a springy joint ``q`` is the motor, as an encoder reads it, and ``q_link`` the link.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from ..errors import InputError
from ..models.floating.arm import FloatingArm
from ..models.floating.symbols import Tip, quaternion_rate, rotation_of, tip
from ..models.model import Model, Placed
from ..models.rig.rig import Rig
from ..models.rigid_body import symbolic_torque
from .equations import Equations, Ledger
from .placed_laws import PlacedLaws, identifier
from .sensors import read_sensors
from .symbolic import quaternion_of, root, solved_symmetric

_NEWTON = 6  # friction in proportion to |load| is piecewise linear: it is met after two or three


@dataclass(frozen=True, eq=False)
class _Rigid:
    """Inertia M, terms c, and the tip at a state; the first ``n_base`` rows are the base's."""

    inertia: ca.SX
    terms: ca.SX
    tip: Tip
    n_base: int


@dataclass(frozen=True)
class Servo:
    """Gains of a servo ``stiffness * (target - q) - damping * qd``, each (J,) [N·m/rad, N·m·s/rad; or N/m, N·s/m]."""

    stiffness: Sequence[float]
    damping: Sequence[float]


def arm_equations(
    model: Model,
    arm: FloatingArm,
    stiff: bool | None = None,
    servo: Servo | None = None,
    start: Sequence[float] | None = None,
) -> Equations:
    """Equations of a model's arm.

    Parameters
    ----------
    model : Model
        Effects and their parameters.
    arm : FloatingArm
        The model's tree on its base, and the tip.
    stiff : bool or None
        Linearly implicit integrator; None: where friction or hidden states are faster than 1 ms.
    servo : Servo or None
        Adds inputs ``servo`` and ``target.<joint>`` to the drive torques.
    start : sequence of float or None
        Default joint positions at the start (J,) [rad or m]; None: zero.

    Raises
    ------
    InputError
        A parameter without a value, a springy joint whose motor has no inertia, or an effect of a suspension rig.
    """
    for p in model.effects:
        if p.effect.at not in ("joint", "link", "sensor"):
            raise InputError(
                f"{model.path}: {p.key} is of a suspension rig or a base, and an FMU of an arm has none; drop it"
            )
    return _Writer(model, arm).written(stiff, servo, [0.0] * len(model.joints) if start is None else start)


class _Writer:
    """Writes one arm into a ledger."""

    def __init__(self, model: Model, arm: FloatingArm) -> None:
        self.model, self.arm, self.ledger = model, arm, Ledger()
        self.joints, self.n = model.joints, len(model.joints)
        self.units = ["m" if j.kind == "prismatic" else "rad" for j in model.tree.joints]
        self.torque_units = ["N" if unit == "m" else "N*m" for unit in self.units]

    def written(self, stiff: bool | None, servo: Servo | None, start: Sequence[float]) -> Equations:
        ledger, n, arm = self.ledger, self.n, self.arm
        self.tau = ca.vertcat(*self._each(ledger.input, "tau", self.torque_units, "drive torque delivered at"))
        words = f"on the tip ({self.model.tree.links[arm.tip_link].name}), in the world frame"
        self.at_tip = ca.vertcat(
            ledger.vector_input("force.tip", "N", f"force from outside {words}"),
            ledger.vector_input("torque.tip", "N*m", f"moment from outside {words}"),
        )
        self.at_base = ca.SX(6, 1)
        if arm.floating:
            words = "on the base at its frame, in the world frame"
            self.at_base = ca.vertcat(
                ledger.vector_input("force.base", "N", f"force from outside {words}"),
                ledger.vector_input("torque.base", "N*m", f"moment from outside {words}"),
            )
        self.laws = laws = PlacedLaws(self.model, ledger)
        self.phi = ca.vertcat(*laws.link_parameters())
        springy = {laws.joint_of(p): p for p in laws.at("joint") if p.effect.acts_on == "position"}
        start_q, start_qd = self._starts(start)
        q, qd = (ca.vertcat(*(ledger.state(s) for s in ca.vertsplit(x))) for x in (start_q, start_qd))
        pose, twist = self._base_states()
        self.turn = rotation_of(pose[3:]) if arm.floating else ca.SX.eye(3)
        if servo is not None:
            self.tau += self._servo(servo, q, qd, start)

        # A spring's twist starts where it carries what the arm weighs at the start.
        weight = self._rigid(start_q, ca.SX(n, 1), ca.SX(6, 1), ca.SX.eye(3), ca.SX(6, 1), ca.SX(6, 1))
        resting = weight.terms[weight.n_base :]
        q_link, qd_link, springs = ca.SX(q), ca.SX(qd), ca.SX(n, 1)
        start_link = ca.SX(start_q)
        twists: dict[int, tuple[ca.SX, ca.SX]] = {}
        for j, p in springy.items():
            stretch = ca.SX.sym("stretch")
            at_rest = root(self._spring(p, j, stretch, ca.SX(0)) - resting[j], stretch)
            twists[j] = ledger.state(at_rest), ledger.state(0.0)
            start_link[j] = start_q[j] - at_rest
            q_link[j], qd_link[j] = q[j] - twists[j][0], qd[j] - twists[j][1]
            springs[j] = self._spring(p, j, *twists[j])

        rigid = self._rigid(q_link, qd_link, twist, self.turn, self.at_tip, self.at_base)
        motion, hidden = (q, qd), self._hidden(start_q, start_qd)
        friction = self._friction(motion, rigid, hidden)
        accelerations, load = self._solved(rigid, friction, springy, springs)
        link_qdd = accelerations[rigid.n_base :]
        qdd = ca.SX(link_qdd)
        for j, p in springy.items():
            qdd[j] = self._motor(friction, j, p, springs[j])
        rates = [*ca.vertsplit(qd), *ca.vertsplit(qdd)]
        if arm.floating:
            rates += ca.vertsplit(self.turn @ twist[:3]) + ca.vertsplit(quaternion_rate(pose[3:], twist[3:]))
            # The equations give the origin's acceleration; seen from the turning base its velocity changes by less.
            rates += ca.vertsplit(accelerations[:3] - ca.cross(twist[3:], twist[:3])) + ca.vertsplit(accelerations[3:6])
        for j in springy:
            rates += [twists[j][1], qdd[j] - link_qdd[j]]
        for p, _ in hidden:
            rates += ca.vertsplit(self._hidden_rate(p, motion, qdd, load, rigid, hidden))

        for k, joint in enumerate(self.joints):
            unit, what = self.units[k], "motor position" if k in springy else "position"
            ledger.output(f"q.{joint}", unit, q[k], f"{what} of {joint}")
            ledger.output(f"qd.{joint}", f"{unit}/s", qd[k], f"rate of q.{joint}")
            ledger.output(f"qdd.{joint}", f"{unit}/s^2", qdd[k], f"rate of qd.{joint}")
            if k in springy:
                ledger.output(f"q_link.{joint}", unit, q_link[k], f"position of the link behind {joint}")
        self._bodies(rigid.tip, pose, twist, qd_link)
        columns = {"q": q, "qd": qd, "qdd": qdd, "load": load, "tau": self.tau, "q_link": q_link}
        signals = [{name: x[j] for name, x in columns.items()} for j in range(n)]
        rates += read_sensors(laws, ledger, signals, {"q": start_q, "q_link": start_link})
        kind = "floating" if arm.floating else "fixed"
        words = ", ".join(dict.fromkeys(p.effect.name for p in self.model.effects)) or "no effects"
        description = f"Arm of {n} joints on a {kind} base: drive torques in, motion out; with {words}."
        return ledger.equations(
            identifier(self.model.name), description, rates, self._stiff(rates) if stiff is None else stiff
        )

    def _each(self, add: Callable[..., ca.SX], stem: str, units: list[str], words: str, *rest: Any) -> list[ca.SX]:
        """One variable a joint."""
        named = zip(self.joints, units, strict=True)
        return [add(f"{stem}.{joint}", unit, *rest, f"{words} {joint}") for joint, unit in named]

    def _starts(self, start: Sequence[float]) -> tuple[ca.SX, ca.SX]:
        """Positions and speeds at the start (J,)."""
        found = ([], [])
        for k, (quantity, rate) in enumerate((("q", ""), ("qd", "/s"))):
            for j, joint in enumerate(self.joints):
                words, unit = f"{quantity}.{joint} at the start", self.units[j] + rate
                value = 0.0 if k else float(start[j])
                found[k].append(self.ledger.parameter(f"start.{quantity}.{joint}", unit, value, words, fixed=True))
        return ca.vertcat(*found[0]), ca.vertcat(*found[1])

    def _servo(self, servo: Servo, q: ca.SX, qd: ca.SX, start: Sequence[float]) -> ca.SX:
        """Torque (J,) of the joints' servo."""
        ledger, total = self.ledger, []
        on = ledger.input("servo", "1", "1: the servo holds the joints at their targets, 0: only tau drives them")
        for j, joint in enumerate(self.joints):
            target = ledger.input(f"target.{joint}", self.units[j], f"where the servo moves {joint}", float(start[j]))
            gains = []
            for word, unit, value in (("stiffness", "T/S", servo.stiffness[j]), ("damping", "T*s/S", servo.damping[j])):
                name, full = f"servo.{joint}.{word}", self.laws.unit(j, unit)
                gains.append(ledger.parameter(name, full, float(value), f"{word} of the servo", (0.0, float("inf"))))
            total.append(on * (gains[0] * (target - q[j]) - gains[1] * qd[j]))
        return ca.vertcat(*total)

    def _base_states(self) -> tuple[ca.SX, ca.SX]:
        """Pose (7,) (position, quaternion w x y z) and twist (6,) of the base in its frame; zeros where it is fixed."""
        if not self.arm.floating:
            return ca.SX([0, 0, 0, 1, 0, 0, 0]), ca.SX(6, 1)
        first = []
        for stem, axes, unit in (
            ("pos", "xyz", "m"),
            ("quat", "wxyz", "1"),
            ("vel", "xyz", "m/s"),
            ("omega", "xyz", "rad/s"),
        ):
            for axis in axes:
                name, words = f"{stem}.base.{axis}", f"{stem}.base.{axis} at the start, in the world frame"
                first.append(self.ledger.parameter(f"start.{name}", unit, float(axis == "w"), words, fixed=True))
        back = rotation_of(ca.vertcat(*first[3:7])).T
        first[7:10], first[10:13] = (ca.vertsplit(back @ ca.vertcat(*first[k : k + 3])) for k in (7, 10))
        states = [self.ledger.state(x) for x in first]
        return ca.vertcat(*states[:7]), ca.vertcat(*states[7:])

    def _rigid(self, q: ca.SX, qd: ca.SX, twist: ca.SX, turn: ca.SX, at_tip: ca.SX, at_base: ca.SX) -> _Rigid:
        """M and c; wrenches (6,) are given in the world frame."""
        arm, n_base = self.arm, 6 if self.arm.floating else 0
        tree = arm.whole if arm.floating else arm.tree
        phi = ca.vertcat(ca.SX(50, 1), ca.SX(arm.base), self.phi) if arm.floating else self.phi
        size = n_base + self.n
        x, y, z = ca.vertsplit(twist[3:])
        # Rates of the carrying joints are the angular velocity, but each axis is turned by the joints before it.
        still = ca.vertcat(ca.SX(3, 1), -y * z, x * z, -x * y)[:n_base]
        position = ca.vertcat(ca.SX(n_base, 1), q)
        velocity, rates = ca.vertcat(twist[:n_base], qd), ca.vertcat(still, ca.SX(self.n, 1))
        gravity = turn.T @ ca.SX(ca.DM(arm.tree.gravity))
        terms = symbolic_torque(tree, position, velocity, rates, gravity, phi)
        acceleration, none = ca.SX.sym("a", size), ca.SX(size, 1)
        inertia = ca.jacobian(symbolic_torque(tree, position, none, acceleration, ca.SX(3, 1), phi), acceleration)
        end = tip(arm, q)
        wrench = ca.vertcat(turn.T @ at_tip[:3], turn.T @ at_tip[3:])
        terms = terms - ca.vertcat(end.by_base.T @ wrench if n_base else ca.SX(0, 1), end.by_joints.T @ wrench)
        if isinstance(self.model.tree, Rig):  # slings in balance take the weight that the model's nominal masses have
            weight = symbolic_torque(tree, position, ca.SX(size, 1), ca.SX(size, 1), gravity, ca.SX(tree.phi))
            terms = terms - weight
        if n_base:
            terms = terms - ca.vertcat(turn.T @ at_base[:3], turn.T @ at_base[3:], ca.SX(self.n, 1))
        return _Rigid(inertia, terms, end, n_base)

    def _spring(self, p: Placed, joint: int, stretch: ca.SX, rate: ca.SX) -> ca.SX:
        """Torque of a springy joint: what its law balances the load with, ``inertia * stretch'' = load - spring``."""
        names = p.effect.states
        load = ca.SX.sym("load")
        given = {**self.laws.signals(joint), "load": load, "inertia": ca.SX(1)}
        found = self.laws.rate(p, {**given, **dict(zip(names, (stretch, rate), strict=len(names) == 2))})
        if len(names) != 2 or not ca.is_equal(ca.simplify(ca.jacobian(found[1], load)), ca.SX(1), 2):
            raise InputError(f"{self.model.path}: {p.key} has no forward dynamics; export with --inverse")
        return -ca.substitute(found[1], load, ca.SX(0))

    def _hidden(self, start_q: ca.SX, start_qd: ca.SX) -> list[tuple[Placed, dict[str, ca.SX]]]:
        """Joint effects with hidden states of their own, and the states' symbols."""
        found = []
        for p in self.laws.at("joint"):
            if p.effect.states and p.effect.acts_on == "torque":
                j = self.laws.joint_of(p)
                at_start = {"q": start_q[j], "qd": start_qd[j], "qdd": ca.SX(0), "load": ca.SX(0), "inertia": ca.SX(1)}
                start = self.laws.steady(p, {**self.laws.signals(j), **at_start})
                found.append(
                    (p, {s: self.ledger.state(x) for s, x in zip(p.effect.states, ca.vertsplit(start), strict=True)})
                )
        return found

    def _signals(self, j: int, motion: tuple[ca.SX, ca.SX], qdd: ca.SX, load: ca.SX, rigid: _Rigid) -> dict[str, ca.SX]:
        own = rigid.inertia[rigid.n_base + j, rigid.n_base + j]
        signals = {"q": motion[0][j], "qd": motion[1][j], "qdd": qdd, "load": load, "inertia": own}
        return self.laws.signals(j) | signals

    def _friction(self, motion: tuple[ca.SX, ca.SX], rigid: _Rigid, hidden: list) -> ca.Function:
        """All that joint effects take of the drive (J,), and its slopes, by acceleration and load (J,) each."""
        qdd, load, taken = ca.SX.sym("qdd", self.n), ca.SX.sym("load", self.n), ca.SX(self.n, 1)
        states = {p.key: s for p, s in hidden}
        for p in self.laws.at("joint"):
            if p.effect.acts_on == "torque":
                j = self.laws.joint_of(p)
                taken[j] += self.laws.law(p, self._signals(j, motion, qdd[j], load[j], rigid) | states.get(p.key, {}))
        self.linear = not any(ca.which_depends(taken, ca.vertcat(qdd, load), 2, False))
        slopes = [ca.diag(ca.jacobian(taken, x)) for x in (qdd, load)]
        self.free = [s for s in ca.symvar(ca.vertcat(taken, *slopes)) if s.name() not in _names(qdd, load)]
        return ca.Function("friction", [qdd, load, *self.free], [taken, *slopes])

    def _solved(self, rigid: _Rigid, friction: ca.Function, springy: dict, springs: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Accelerations (n_base + J,) and rigid-body torque (J,)."""
        size, base = rigid.inertia.shape[0], rigid.n_base
        found = ca.SX(size, 1)
        for _ in range(1 if self.linear else _NEWTON):
            force = rigid.inertia @ found + rigid.terms
            load = force[base:]
            taken, by_qdd, by_load = friction(found[base:], load, *self.free)
            residual, added = ca.SX(force), ca.SX(size, 1)
            for j in range(self.n):
                if j in springy:
                    residual[base + j] = load[j] - springs[j]
                else:
                    residual[base + j] = (load[j] + taken[j] - self.tau[j]) / (1 + by_load[j])
                    added[base + j] = by_qdd[j] / (1 + by_load[j])
            found = found - solved_symmetric(rigid.inertia + ca.diag(added), residual)
        return found, rigid.inertia[base:, :] @ found + rigid.terms[base:]

    def _motor(self, friction: ca.Function, j: int, p: Placed, spring: ca.SX) -> ca.SX:
        """Acceleration of the motor before a spring."""
        load = ca.SX(self.n, 1)
        load[j] = spring
        taken, by_qdd, _ = friction(ca.SX(self.n, 1), load, *self.free)
        own = f"rotor_inertia.{self.joints[j]}"
        if by_qdd[j].is_zero() or not self.model.values.get(f"{own}.inertia", 0) > 0:
            raise InputError(
                f"{self.model.path}: {p.key} leaves the motor without inertia, so its motion is not determined; add "
                f'{{ name = "rotor_inertia", at = "{self.joints[j]}" }} to effects and a positive "{own}.inertia" to '
                "[parameters], or export with --inverse"
            )
        return (self.tau[j] - spring - taken[j]) / by_qdd[j]

    def _hidden_rate(self, p: Placed, motion: tuple, qdd: ca.SX, load: ca.SX, rigid: _Rigid, hidden: list) -> ca.SX:
        j, states = self.laws.joint_of(p), dict((q.key, s) for q, s in hidden)[p.key]
        return self.laws.rate(p, self._signals(j, motion, qdd[j], load[j], rigid) | states)

    def _bodies(self, end: Tip, pose: ca.SX, twist: ca.SX, qd: ca.SX) -> None:
        """Pose and twist of the tip, and of a floating base, in the world frame."""
        ledger, turn = self.ledger, self.turn
        rate = end.by_base @ twist + end.by_joints @ qd
        bodies = [("tip", pose[:3] + turn @ end.translation, quaternion_of(turn @ end.rotation), rate)]
        if self.arm.floating:
            bodies.append(("base", pose[:3], pose[3:] / ca.norm_2(pose[3:]), twist))
        for body, position, quaternion, motion in bodies:
            ledger.vector(f"pos.{body}", "m", position, f"position of {body} in the world frame")
            ledger.vector(
                f"quat.{body}", "1", quaternion, f"attitude of {body} in the world frame (quaternion)", "wxyz"
            )
            ledger.vector(f"vel.{body}", "m/s", turn @ motion[:3], f"velocity of {body} in the world frame")
            ledger.vector(f"omega.{body}", "rad/s", turn @ motion[3:], f"angular velocity of {body} in the world frame")

    def _stiff(self, rates: list[ca.SX]) -> bool:
        """Whether 1 ms is too long for explicit Runge-Kutta, at rest or with every joint at 0.1 rad/s or m/s."""
        return any(
            self.ledger.fastest(rates, {self.n + j: speed for j in range(self.n)}) > 2000.0 for speed in (0.0, 0.1)
        )


def _names(*columns: ca.SX) -> set[str]:
    return {symbol.name() for column in columns for symbol in ca.vertsplit(column)}
