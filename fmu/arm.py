"""Forward dynamics of an arm with every effect of a model file.

Accelerations a (of a floating base, then of the J links) solve, with M the inertia, c the velocity and gravity terms
less what acts from outside, ``load = M a + c`` the rigid-body torque, w the wrench that effects give the base, and
``rig`` the torque that a rig's slings, slides and booms take beyond their balance::

    base:          load_base = w(a_base)
    rigid joint:   load_j + rig_j + friction_j(q, qd, qdd_j, load_j) = tau_j
    springy joint: load_j + rig_j = spring_j,   friction_j(q, qd, qdd_motor, spring_j) + spring_j = tau_j

by Newton's method with the symmetric matrix ``M + diag((d friction / d qdd) / (1 + d friction / d load))``, less
``d w / d a_base``; one step is exact where friction is linear in acceleration and load, as w is (Featherstone 2008,
chapters 6 and 8, for M, c and M's factors).
At a springy joint ``q`` is the motor, as an encoder reads it, and ``q_link`` the link. An elastic link is cut, and
joined by rigid joints that its springs drive (`beams`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

import casadi as ca

from ..errors import InputError
from ..models.empirical import TableLaw
from ..models.floating.arm import FloatingArm
from ..models.floating.tree import FloatingTree, floating_tree
from ..models.model import Model, PlacedEffect
from ..models.rig.rig import Rig
from .accelerations import JointForces, accelerations_of
from .base import Base
from .beams import Turns, with_turns
from .equations import Equations, Ledger
from .placed_laws import PlacedLaws, identifier, summed
from .rigid_arm import RigidArm, body_outputs, rigid
from .sensors import delivered, read_sensors
from .suspension import PLACES, rig_reach, rig_signals
from .symbolic import root


@dataclass(frozen=True)
class ServoGains:
    """Gains of a servo ``stiffness * (target - q) - damping * qd``, each (J,) [N·m/rad, N·m·s/rad; or N/m, N·s/m]."""

    stiffness: Sequence[float]
    damping: Sequence[float]


def arm_equations(
    model: Model,
    arm: FloatingArm,
    stiff: bool | None = None,
    servo: ServoGains | None = None,
    start: Sequence[float] | None = None,
) -> Equations:
    """Equations of a model's arm.

    Parameters
    ----------
    model : Model
        Effects and their parameters.
    arm : FloatingArm
        The model's tree on its base, and the tip; inputs and outputs ``mount`` where a floating one has a mount.
    stiff : bool or None
        Linearly implicit integrator; None: where friction or hidden states are faster than 1 ms.
    servo : ServoGains or None
        Adds inputs ``servo`` and ``target.<joint>`` to the drive torques.
    start : sequence of float or None
        Default joint positions at the start (J,) [rad or m]; None: zero.

    Raises
    ------
    InputError
        A parameter without a value, or a springy joint whose motor has no inertia.
    """
    arm, turns = with_turns(model, arm)
    if arm.floating and (turns or not isinstance(model.tree, FloatingTree)):
        model = replace(model, tree=replace(floating_tree(arm), axes=model.tree.axes))
    elif turns:
        model = replace(model, tree=arm.tree)
    return _Writer(model, arm, turns).written(stiff, servo, start)


class _Writer:
    """Writes one arm into a ledger."""

    def __init__(self, model: Model, arm: FloatingArm, turns: tuple[Turns, ...]) -> None:
        self.model, self.arm, self.ledger, self.turns = model, arm, Ledger(), turns
        self.joints, self.n = model.joints[model.tree.carriers :], arm.n_joints
        self.units = ["m" if j.kind == "prismatic" else "rad" for j in arm.tree.joints]
        self.torque_units = ["N" if unit == "m" else "N*m" for unit in self.units]
        virtual = {j for x in turns for j in x.joints}
        self.real = [j for j in range(self.n) if j not in virtual]
        """Joints that a drive moves; the others are springs in links."""

    def written(self, stiff: bool | None, servo: ServoGains | None, given: Sequence[float] | None) -> Equations:
        ledger, n, arm, tree = self.ledger, self.n, self.arm, self.model.tree
        start = dict(zip(self.real, [0.0] * len(self.real) if given is None else given, strict=True))
        self.tau = self._inputs()
        words = f"on the tip ({arm.tree.links[arm.tip_link].name}), in the world frame"
        at_tip = ca.vertcat(
            ledger.vector_input("force.tip", "N", f"force from outside {words}"),
            ledger.vector_input("torque.tip", "N*m", f"moment from outside {words}"),
        )
        self.laws = laws = PlacedLaws(self.model, ledger)
        phi = ca.vertcat(*laws.link_parameters())
        springy = {laws.joint_of(p): p for p in laws.at("joint") if p.effect.acts_on == "position"}
        start_q, start_qd = self._starts(start)
        load = rigid(tree, arm, phi, start_q, ca.SX(n, 1)).terms[-n:] if self.turns else ca.SX(n, 1)
        for x in self.turns:
            start_q[list(x.joints)] = x.start(laws, load)
        q, qd = (ca.vertcat(*(ledger.state(s) for s in ca.vertsplit(x))) for x in (start_q, start_qd))
        self.base = base = Base(arm, ledger, laws)
        for x in self.turns:
            self.tau[list(x.joints)] = x.spring(laws, q, qd)
        if servo is not None:
            self.tau += self._servo(servo, q, qd, start)
        command = self.tau
        self.tau, command_rates = delivered(laws, ledger, command, (q, qd), (start_q, start_qd))

        # A spring's twist starts where it carries what the arm weighs at the start.
        resting = rigid(tree, arm, phi, start_q, ca.SX(n, 1)).terms[base.size :]
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

        now = rigid(tree, arm, phi, q_link, qd_link, base, at_tip)
        motion, hidden = (q, qd), self._hidden(start_q, start_qd)
        on_rig, rig_rates = self._rig(q_link, qd_link, start_link, start_qd)
        friction = self._friction(motion, now, hidden)
        on_joints = JointForces(
            friction, self.free, self.linear, self._across(springy), on_rig, self.tau, springs, tuple(springy)
        )
        accelerations, load = accelerations_of(now, base, on_joints)
        link_qdd = accelerations[base.size :]
        qdd = ca.SX(link_qdd)
        for j, p in springy.items():
            qdd[j] = self._motor(friction, j, p, springs[j])
        rates = [*ca.vertsplit(qd), *ca.vertsplit(qdd), *base.rates(accelerations[: base.size]), *command_rates]
        for j in springy:
            rates += [twists[j][1], qdd[j] - link_qdd[j]]
        for p, _ in hidden:
            rates += ca.vertsplit(self._hidden_rate(p, motion, qdd, load, now, hidden))
        rates += rig_rates

        for x in self.turns:
            for j in x.joints:
                ledger.output(f"turn.{self.joints[j]}", "rad", q[j], f"turn of the far end of {x.placed.at}")
        for k in self.real:
            joint = self.joints[k]
            unit, what = self.units[k], "motor position" if k in springy else "position"
            ledger.output(f"q.{joint}", unit, q[k], f"{what} of {joint}")
            ledger.output(f"qd.{joint}", f"{unit}/s", qd[k], f"rate of q.{joint}")
            ledger.output(f"qdd.{joint}", f"{unit}/s^2", qdd[k], f"rate of qd.{joint}")
            if k in springy:
                ledger.output(f"q_link.{joint}", unit, q_link[k], f"position of the link behind {joint}")
        for p in laws.at("joint"):
            if isinstance(p.effect.law, TableLaw):
                states = dict((q.key, s) for q, s in hidden).get(p.key, {})
                laws.tell_held(p.at, p.effect.law.held(self._signals(p, motion, qdd, load, now) | states))
        body_outputs(ledger, arm, base, now.tip, qd_link)
        columns = {"q": q, "qd": qd, "qdd": qdd, "load": load, "tau": command, "q_link": q_link}
        signals = [{name: x[j] for name, x in columns.items()} for j in range(n)]
        rates += read_sensors(laws, ledger, signals, {"q": start_q, "q_link": start_link})
        kind = "floating" if arm.floating else "fixed"
        words = ", ".join(dict.fromkeys(p.effect.name for p in self.model.effects)) or "no effects"
        description = f"Arm of {len(self.real)} joints on a {kind} base: drive torques in, motion out; with {words}."
        return ledger.equations(
            identifier(self.model.name), description, rates, self._stiff(rates) if stiff is None else stiff
        )

    def _inputs(self) -> ca.SX:
        """Torque that each drive delivers, or is told to deliver (J,)."""
        late, found = {p.at for p in self.model.effects if p.effect.leads}, ca.SX(self.n, 1)
        for j in self.real:
            joint, unit = self.joints[j], self.torque_units[j]
            words = "commanded" if f"tau.{joint}" in late else "delivered"
            found[j] = self.ledger.input(f"tau.{joint}", unit, f"drive torque {words} at {joint}")
        return found

    def _starts(self, start: Mapping[int, float]) -> tuple[ca.SX, ca.SX]:
        """Positions and speeds at the start (J,), zero where a spring decides."""
        found = ca.SX(self.n, 1), ca.SX(self.n, 1)
        for k, (quantity, rate) in enumerate((("q", ""), ("qd", "/s"))):
            for j in self.real:
                joint = self.joints[j]
                words, unit = f"{quantity}.{joint} at the start", self.units[j] + rate
                value, own = 0.0 if k else float(start[j]), self.arm.tree.joints[j]
                bounds = (-inf, inf) if k else (own.lower, own.upper)
                name = f"start.{quantity}.{joint}"
                found[k][j] = self.ledger.parameter(name, unit, value, words, bounds, fixed=True)
        return found

    def _servo(self, servo: ServoGains, q: ca.SX, qd: ca.SX, start: Mapping[int, float]) -> ca.SX:
        """Torque (J,) of the joints' servo."""
        ledger, total = self.ledger, ca.SX(self.n, 1)
        on = ledger.input("servo", "1", "1: the servo holds the joints at their targets, 0: only tau drives them")
        for i, j in enumerate(self.real):
            joint = self.joints[j]
            target = ledger.input(f"target.{joint}", self.units[j], f"where the servo moves {joint}", float(start[j]))
            gains = []
            for word, unit, value in (("stiffness", "T/S", servo.stiffness[i]), ("damping", "T*s/S", servo.damping[i])):
                name, full = f"servo.{joint}.{word}", self.laws.unit(j, unit)
                gains.append(ledger.parameter(name, full, float(value), f"{word} of the servo", (0.0, inf)))
            total[j] = on * (gains[0] * (target - q[j]) - gains[1] * qd[j])
        return total

    def _spring(self, p: PlacedEffect, joint: int, stretch: ca.SX, rate: ca.SX) -> ca.SX:
        """Torque of a springy joint: what its law balances the load with, ``inertia * stretch'' = load - spring``."""
        names = p.effect.states
        load = ca.SX.sym("load")
        given = {**self.laws.signals(p), "load": load, "inertia": ca.SX(1)}
        found = self.laws.rate(p, {**given, **dict(zip(names, (stretch, rate), strict=len(names) == 2))})
        if len(names) != 2 or not ca.is_equal(ca.simplify(ca.jacobian(found[1], load)), ca.SX(1), 2):
            raise InputError(f"{self.model.path}: {p.key} has no forward dynamics; export with --inverse")
        return -ca.substitute(found[1], load, ca.SX(0))

    def _hidden(self, start_q: ca.SX, start_qd: ca.SX) -> list[tuple[PlacedEffect, dict[str, ca.SX]]]:
        """Joint effects with hidden states of their own, and the states' symbols."""
        found = []
        for p in self.laws.at("joint"):
            if p.effect.states and p.effect.acts_on == "torque":
                along = self.laws.place_of(p).along
                at_start = {"q": summed(along, start_q), "qd": summed(along, start_qd), "inertia": ca.SX(1)}
                at_start |= dict.fromkeys(("qdd", "load"), ca.SX(0))
                start = self.laws.steady(p, {**self.laws.signals(p), **at_start})
                found.append(
                    (p, {s: self.ledger.state(x) for s, x in zip(p.effect.states, ca.vertsplit(start), strict=True)})
                )
        return found

    def _rig(self, q: ca.SX, qd: ca.SX, start_q: ca.SX, start_qd: ca.SX) -> tuple[ca.SX, list[ca.SX]]:
        """Torque (J,) that slings, slides and booms of a rig take of the drives, and the rates of their states."""
        rig, laws, taken, rates = self.model.tree, self.laws, ca.SX(self.n, 1), []
        for p in laws.at(*PLACES):
            assert isinstance(rig, Rig)
            j = laws.joint_of(p)
            own = laws.signals(p) | {"q": q[j], "qd": qd[j]}
            signals, states = own | rig_signals(rig, p, q, qd), {}
            if p.effect.states:
                rest = laws.steady(p, own | rig_signals(rig, p, start_q, start_qd))
                states = {s: self.ledger.state(x) for s, x in zip(p.effect.states, ca.vertsplit(rest), strict=True)}
                rates += ca.vertsplit(laws.rate(p, signals | states))
            taken += rig_reach(rig, p, q) @ laws.law(p, signals | states)
        return taken, rates

    def _signals(
        self, p: PlacedEffect, motion: tuple[ca.SX, ca.SX], qdd: ca.SX, load: ca.SX, now: RigidArm
    ) -> dict[str, ca.SX]:
        """What a law at a joint or an axis reads, of the joints' accelerations and loads (J,)."""
        here, base = self.laws.place_of(p), self.base.size
        along = {"q": motion[0], "qd": motion[1], "qdd": qdd}
        matrix = now.inertia[base:, base:]
        across = ca.vertcat(*(summed(here.back, matrix[j, :].T) for j in range(self.n)))
        signals = {name: summed(here.along, x) for name, x in along.items()}
        signals |= {"load": summed(here.back, load), "inertia": summed(here.back, across)}
        signals |= self.laws.of_others(p, *motion)
        return self.laws.signals(p) | signals

    def _friction(self, motion: tuple[ca.SX, ca.SX], now: RigidArm, hidden: list) -> ca.Function:
        """All that effects at joints and axes take of the drives (J,), and its slopes, by acceleration and load
        (J, J) each."""
        qdd, load, taken = ca.SX.sym("qdd", self.n), ca.SX.sym("load", self.n), ca.SX(self.n, 1)
        states = {p.key: s for p, s in hidden}
        for p in self.laws.at("joint"):
            if p.effect.acts_on == "torque":
                law = self.laws.law(p, self._signals(p, motion, qdd, load, now) | states.get(p.key, {}))
                here = self.laws.place_of(p)
                for j in here.channels:
                    taken[int(j)] += law if here.alone is not None else float(here.along[j]) * law
        self.linear = not any(ca.which_depends(taken, ca.vertcat(qdd, load), 2, False))
        slopes = [ca.jacobian(taken, x) for x in (qdd, load)]
        self.free = [s for s in ca.symvar(ca.veccat(taken, *slopes)) if s.name() not in _names(qdd, load)]
        return ca.Function("friction", [qdd, load, *self.free], [taken, *slopes])

    def _across(self, springy: dict[int, PlacedEffect]) -> bool:
        """Whether an effect acts along several joints at once; InputError beside a springy joint."""
        across = [p for p in self.laws.at("joint") if self.laws.place_of(p).alone is None]
        if across and springy:
            spring = next(iter(springy.values()))
            raise InputError(
                f"{self.model.path}: {across[0].key} acts along an axis, and {spring.key} is a spring: their forward "
                "dynamics together are not written; export with --inverse"
            )
        return bool(across)

    def _motor(self, friction: ca.Function, j: int, p: PlacedEffect, spring: ca.SX) -> ca.SX:
        """Acceleration of the motor before a spring."""
        load = ca.SX(self.n, 1)
        load[j] = spring
        taken, by_qdd, _ = friction(ca.SX(self.n, 1), load, *self.free)
        own = f"rotor_inertia.{self.joints[j]}"
        if by_qdd[j, j].is_zero() or not self.model.values.get(f"{own}.inertia", 0) > 0:
            raise InputError(
                f"{self.model.path}: {p.key} leaves the motor without inertia, so its motion is not determined; add "
                f'{{ name = "rotor_inertia", at = "{self.joints[j]}" }} to effects and a positive "{own}.inertia" to '
                "[parameters], or export with --inverse"
            )
        return (self.tau[j] - spring - taken[j]) / by_qdd[j, j]

    def _hidden_rate(
        self, p: PlacedEffect, motion: tuple, qdd: ca.SX, load: ca.SX, now: RigidArm, hidden: list
    ) -> ca.SX:
        states = dict((q.key, s) for q, s in hidden)[p.key]
        return self.laws.rate(p, self._signals(p, motion, qdd, load, now) | states)

    def _stiff(self, rates: list[ca.SX]) -> bool:
        """Whether 1 ms is too long for explicit Runge-Kutta, at rest or with every joint at 0.1 rad/s or m/s."""
        return any(
            self.ledger.fastest(rates, {self.n + j: speed for j in range(self.n)}) > 2000.0 for speed in (0.0, 0.1)
        )


def _names(*columns: ca.SX) -> set[str]:
    return {symbol.name() for column in columns for symbol in ca.vertsplit(column)}
