"""A model run natively: pinocchio's rigid bodies, the effects' own laws, and scipy's integrator. Nothing of an FMU."""

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp
from scipy.optimize import root

from snarelab.models.floating.tree import CARRIERS
from snarelab.models.hidden_state import SIGNALS, reads
from snarelab.models.rig.kinematics import boom_map, place_map, sling_of
from snarelab.models.rig.points import far_end, point_motion
from snarelab.models.rig.rig import Rig

ENGINE: Any = pin  # its stubs lack most names


def body(phi):
    """pinocchio's inertia of phi (10,)."""
    if not phi[0]:
        return ENGINE.Inertia.Zero()
    lever = phi[1:4] / phi[0]
    about = np.array([[phi[4], phi[5], phi[6]], [phi[5], phi[7], phi[8]], [phi[6], phi[8], phi[9]]])
    return ENGINE.Inertia(phi[0], lever, about - phi[0] * (lever @ lever * np.eye(3) - np.outer(lever, lever)))


def engine_of(tree, phi):
    """pinocchio's model of a tree; a floating one's carriers are a free flyer."""
    model, carriers = ENGINE.Model(), tree.carriers
    ids = {-1: 0}
    if carriers:
        ids[CARRIERS - 1] = model.addJoint(0, ENGINE.JointModelFreeFlyer(), ENGINE.SE3.Identity(), "base")
        model.appendBodyToJoint(ids[CARRIERS - 1], body(phi[CARRIERS - 1]), ENGINE.SE3.Identity())
    for k, joint in enumerate(tree.joints[carriers:], carriers):
        kind = {"revolute": ENGINE.JointModelRevoluteUnaligned, "prismatic": ENGINE.JointModelPrismaticUnaligned}
        pose = ENGINE.SE3(joint.rotation, joint.translation)
        ids[k] = model.addJoint(ids[joint.parent], kind[joint.kind](joint.axis), pose, joint.name)
        model.appendBodyToJoint(ids[k], body(phi[k]), ENGINE.SE3.Identity())
    model.gravity = ENGINE.Motion(np.asarray(tree.gravity), np.zeros(3))
    return model, model.createData()


class Law:
    """One placed effect with its numbers."""

    def __init__(self, p, values):
        self.effect, self.at, self.key = p.effect, p.at, p.key
        self.numbers = {x.name: values[f"{p.key}.{x.name}"] for x in p.effect.parameters}
        self.sizes = SIGNALS[p.effect.at]
        s = {name: ca.SX.sym(name, size) for name, size in self.sizes.items()}
        x = {name: ca.SX.sym(name) for name in p.effect.states}
        given = {name: ca.SX(value) for name, value in self.numbers.items()}
        law = ca.vertcat(p.effect.law(s | x, given))
        rate = ca.vertcat(*p.effect.rate(s | x, given)) if p.effect.rate else ca.SX(0, 1)
        self._f = ca.Function("f", [*s.values(), ca.vertcat(*x.values()) if x else ca.SX(0, 1)], [law, rate])

    def __call__(self, signals, x=()):
        given = [signals.get(name, np.zeros(size)) for name, size in self.sizes.items()]
        law, rate = self._f(*given, np.asarray(x, float))
        return np.array(law).ravel(), np.array(rate).ravel()

    def steady(self, signals):
        """Hidden states that stay; zero where they accumulate, and at a base."""
        zero = np.zeros(len(self.effect.states))
        if self.effect.at == "base" or self.effect.from_zero or not len(zero):
            return zero
        return root(lambda x: self(signals, x)[1], zero, tol=1e-14).x


class Native:
    """One model: forward dynamics with the effects named in ``active``, drive torques (J,) and wheels' torque held.

    ``before`` (J,): the torques that were commanded until the start, where they were others."""

    def __init__(self, model, active, tau, wheels=(0.0, 0.0, 0.0), before=None):
        tree = self.tree = model.tree
        self.tau, self.wheels, self.values = np.asarray(tau, float), np.asarray(wheels, float), model.values
        self.before = self.tau if before is None else np.asarray(before, float)
        self.n, self.base = len(self.tau), tree.carriers
        self.names = [joint.name for joint in tree.joints[self.base :]]
        self.laws = [Law(p, model.values) for p in model.effects if p.effect.name in active]
        phi, links = [link.phi.copy() for link in tree.links], [link.name for link in tree.links]
        for law in [x for x in self.laws if x.effect.at == "link"]:
            k = links.index(law.at)
            phi[k] += law({"phi": tree.links[k].phi, "tip": far_end(tree, k)})[0] - tree.links[k].phi
        self.engine, self.nominal = engine_of(tree, phi), engine_of(tree, [link.phi for link in tree.links])

    def run(self, q, qd, duration):
        """Positions, speeds, the base's pose and twist and the sensors' readings, by name, at the end."""
        q, qd = np.asarray(q, float), np.asarray(qd, float)
        parts = [q, qd, [0, 0, 0, 1, *[0] * 9, 0, 0, 0]] if self.base else [q, qd]
        first = [self._channel(law, q, self.before) for law in self.laws]
        parts += [
            law.steady(self._signals(law, 0.0, q, qd) | {"value": x}) for law, x in zip(self.laws, first, strict=True)
        ]
        y = solve_ivp(self._rate, (0, duration), np.concatenate(parts), "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        q, qd, base, states = self._split(y)
        found = {f"{n}.{j}": x for n, xs in (("q", q), ("qd", qd)) for j, x in zip(self.names, xs, strict=True)}
        if self.base:
            turn = ENGINE.Quaternion(*(base[3:7] / np.linalg.norm(base[3:7]))).toRotationMatrix()
            for kind, x in (("pos", base[:3]), ("vel", turn @ base[7:10]), ("omega", turn @ base[10:13])):
                found |= {f"{kind}.base.{a}": v for a, v in zip("xyz", x, strict=True)}
        for law in self.laws:  # the sensors of one channel read one after another
            if law.effect.leads:
                found[f"delivered.{law.at.removeprefix('tau.')}"] = law({}, states[law.key])[0][0]
            elif law.effect.at == "sensor":
                channel = f"sensor.{law.at}"
                value = found.get(channel, self._channel(law, q))
                own = self._signals(law, duration, q, qd) | {"value": value}
                found[channel] = law(own, states[law.key])[0][0]
        return found

    def _split(self, y):
        """Joints' positions and speeds; base: pose, twist in its axes, wheels' impulse; hidden states by effect."""
        n, states = self.n, {}
        base, rest = np.split(y[2 * n :], [16 if self.base else 0])
        for law in self.laws:
            states[law.key], rest = np.split(rest, [len(law.effect.states)])
        return y[:n], y[n : 2 * n], base, states

    def _channel(self, law, q, tau=None):
        """What a sensor should read."""
        if law.effect.at != "sensor":
            return 0.0
        kind, _, joint = law.at.partition(".")
        tau = self.tau if tau is None else tau
        return (q if kind == "q" else tau)[self.names.index(joint)]

    def _delivered(self, states):
        """Torque of the drives, of late ones what their states make of the command."""
        tau = self.tau.copy()
        for law in self.laws:
            if law.effect.leads:
                tau[self.names.index(law.at.removeprefix("tau."))] = law({}, states[law.key])[0][0]
        return tau

    def _signals(self, law, t, q, qd):
        """What a law at a joint or on a rig reads of the motion."""
        if law.effect.at == "sling":
            sling = sling_of(self.tree, law.at)
            velocity = point_motion(self.tree, sling.link, sling.point, q[None], qd[None]).velocity[0]
            return {"velocity": velocity, "weight": sling.weight, "tension": sling.tension, "time": t}
        if law.effect.at == "boom":
            link = [k.name for k in self.tree.links].index(law.at)
            return {"spread": boom_map(self.tree, link, q[None])[1][0], "time": t}
        if law.effect.at not in ("joint", "slide", "sensor"):
            return {"time": t}
        along = self._along(law)
        speed = self.values.get(f"speed_scale.{law.at}", 0.0)
        return {"q": along @ q, "qd": along @ qd, "time": t, "speed_scale": speed}

    def _along(self, law):
        """A joint's own coordinate (J,), or the sum or difference of two."""
        at = law.at.partition(".")[2] if law.effect.at == "sensor" else law.at
        if at in self.names:
            return np.eye(self.n)[self.names.index(at)]
        sign = "+" if "+" in at else "-"
        one, other = (self.names.index(name) for name in at.split(sign))
        return np.eye(self.n)[one] + (1 if sign == "+" else -1) * np.eye(self.n)[other]

    def _felt(self, law, q, value):
        """What a law's numbers do to the base and the joints."""
        felt = np.zeros(self.base + self.n)
        if law.effect.at == "base":
            felt[:6] = value
        elif law.effect.at == "joint":
            felt[self.base :] = -self._along(law) * value[0]
        else:
            felt[self.base :] = -place_map(self.tree, law.effect.at, law.at, q[None])[0] @ value
        return felt

    def _rate(self, t, y):
        q, qd, base, states = self._split(y)
        place = np.concatenate([base[:3], base[[4, 5, 6, 3]], q]) if self.base else q
        speed = np.concatenate([base[7:13], qd]) if self.base else qd
        inertia = ENGINE.crba(*self.engine, place)
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        terms = ENGINE.nonLinearEffects(*self.engine, place, speed)
        if isinstance(self.tree, Rig):
            terms = terms - ENGINE.computeGeneralizedGravity(*self.nominal, place)
        velocity, spin, impulse = base[7:10], base[10:13], base[13:16]
        if self.base:
            terms[3:6] -= self.wheels + np.cross(spin, impulse)
        read = {law.key: self._signals(law, t, q, qd) for law in self.laws}
        driven = np.concatenate([np.zeros(self.base), self._delivered(states)])
        acting = [law for law in self.laws if law.effect.at not in ("link", "sensor")]
        reacting = [law for law in acting if {"qdd", "load", "spin_rate", "acceleration"} & set(reads(law.effect))]
        for law in acting:
            if law.effect.at == "base":
                read[law.key] |= {"spin": spin, "spin_gained": spin, "impulse": impulse}
            if law not in reacting:
                driven = driven + self._felt(law, q, law(read[law.key], states[law.key])[0])

        def given(law, a):
            """What a law reads at accelerations, pinocchio's: the base's are seen from the turning base."""
            load = inertia @ a + terms
            if law.effect.at == "joint":
                j = self.base + self.names.index(law.at)
                return read[law.key] | {"qdd": a[j], "load": load[j], "inertia": inertia[j, j]}
            return read[law.key] | {"spin_rate": a[3:6], "acceleration": a[:3] + np.cross(spin, velocity)}

        def residual(a):
            left = inertia @ a + terms - driven
            for law in reacting:
                left -= self._felt(law, q, law(given(law, a), states[law.key])[0])
            return left

        a = np.linalg.solve(inertia, driven - terms)
        for _ in range(2 if reacting else 0):
            here = residual(a)
            a = a - np.linalg.solve(np.column_stack([residual(a + e) - here for e in np.eye(len(a))]), here)
        rates = [qd, a[self.base :]]
        if self.base:
            w, vector = base[3], base[4:7]
            turn = ENGINE.Quaternion(w, *vector).toRotationMatrix()
            quaternion = 0.5 * np.concatenate([[-vector @ spin], w * spin + np.cross(vector, spin)])
            rates += [turn @ velocity, quaternion, a[:6], self.wheels]
        for law in self.laws:
            if law.effect.states:
                seen = given(law, a) if law in reacting else read[law.key] | {"value": self._channel(law, q)}
                rates.append(law(seen, states[law.key])[1])
        return np.concatenate(rates)


def springy(inertia, motor, tau, torque, duration):
    """Motor's and link's place of one joint from rest, the spring's ``torque(twist, twist rate)`` between them."""

    def rate(_, y):
        spring = torque(y[0] - y[1], y[2] - y[3])
        return [y[2], y[3], (tau - spring) / motor, spring / inertia]

    return solve_ivp(rate, (0, duration), np.zeros(4), "DOP853", rtol=1e-12, atol=1e-13).y[:2, -1]
