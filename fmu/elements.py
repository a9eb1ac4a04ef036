"""Built-in models: a joint's friction, the target on its suspension, and two arms."""

from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np

from ..models.effect import written_unit
from ..models.effects import get_effect
from ..models.floating.arm import FloatingArm
from ..models.floating.ets_vii import ets_vii
from ..models.floating.space_arm import CAPTURE_POSE, space_arm, space_arm_drive
from ..models.model import Model
from .arm import ServoGains, arm_equations
from .equations import Equations, Ledger

#: Friction laws of the joint element, in this order.
_FRICTION = ("coulomb_friction", "stribeck_friction", "viscous_friction", "quadratic_friction")


def joint_friction() -> Equations:
    """Friction of one revolute joint: speed in, torque out, by the laws of the effect vocabulary.

    With ``q``, ``qd`` and the drive's torque wired to an arm without friction, subtract ``torque``. All levels start at
    zero but a plain Coulomb and viscous pair.
    """
    ledger = Ledger()
    qd = ledger.input("qd.joint", "rad/s", "speed of the joint")
    words = "peak speed of the joint; friction turns over within 0.1 % of it"
    signals = {"qd": qd, "speed_scale": ledger.parameter("speed_scale.joint", "rad/s", 1.0, words, (1e-9, ca.inf))}
    starts = {"coulomb_friction.level": 1.0, "viscous_friction.coefficient": 1.0}
    torque = ca.SX(0)
    for name in _FRICTION:
        effect = get_effect(name)
        given = {}
        for p in effect.parameters:
            start = starts.get(f"{name}.{p.name}", p.zero)
            bounds = (p.low, ca.inf if p.relative_to else p.high)
            given[p.name] = ledger.parameter(
                f"{name}.joint.{p.name}", written_unit(p.unit), start, f"{p.meaning}: {effect.sentence}", bounds
            )
        torque += effect.law(signals, given)
    ledger.output("tau.joint", "N*m", torque, "torque that friction takes; against the speed")
    words = f"Friction of one joint: speed in, torque out; {', '.join(_FRICTION)}."
    return ledger.equations("joint_friction", words, [], stiff=False)


def suspended_target() -> Equations:
    """The target on its suspension: a mass on a springy line, free to swing.

    In the frame of the hang point, x upward, with r the target's place from the point, stretch s = |r| - length::

        mass r'' = force + weight - (stiffness s + damping s') r / |r| - drag r'

    The line cannot push. The target starts at rest where spring and weight balance.
    """
    ledger = Ledger()
    force = ledger.vector_input("force.target", "N", "force from outside on the target, x upward")
    mass = ledger.parameter("mass", "kg", 25.0, "mass of the target", (1e-6, ca.inf))
    length = ledger.parameter("length", "m", 2.0, "length of the line without load", (1e-6, ca.inf))
    stiffness = ledger.parameter("stiffness", "N/m", 1e5, "stiffness of the line", (1e-6, ca.inf))
    damping = ledger.parameter("damping", "N*s/m", 100.0, "damping along the line", (0.0, ca.inf))
    drag = ledger.parameter("drag", "N*s/m", 0.0, "resistance to the target's motion", (0.0, ca.inf))
    gravity = ledger.parameter("gravity", "m/s^2", 9.81, "acceleration of gravity, downward along x", (0.0, ca.inf))
    rest = length + mass * gravity / stiffness
    offset = ca.vertcat(*(ledger.state() for _ in range(3)))  # from where it rests: small numbers keep their digits
    velocity = ca.vertcat(*(ledger.state() for _ in range(3)))
    place = offset - ca.vertcat(rest, 0, 0)
    distance = ca.norm_2(place)
    along = place / distance
    pull = ca.fmax(0, stiffness * (distance - length) + damping * ca.dot(along, velocity))
    weight = ca.vertcat(-mass * gravity, 0, 0)
    acceleration = (force + weight - pull * along - drag * velocity) / mass
    ledger.vector("pos.target", "m", offset, "place of the target from where it rests, x upward")
    ledger.vector("vel.target", "m/s", velocity, "velocity of the target")
    ledger.vector("acc.target", "m/s^2", acceleration, "acceleration of the target")
    ledger.output("tension.line", "N", pull, "tension of the line")
    rates = [*ca.vertsplit(velocity), *ca.vertsplit(acceleration)]
    words = "A target that hangs on a springy line and swings: force in, motion and tension out."
    return ledger.equations("suspended_target", words, rates, stiff=False)


def ets_vii_arm() -> Equations:
    """The arm of six joints on the floating base of ETS-VII, with the inertias as published."""
    arm = ets_vii()
    path = Path(arm.tree.name)
    model = Model(path, "ets_vii_arm", "free_floating_arm", None, arm.tree, "fixed", (), {}, None, {})
    return arm_equations(model, arm)


def station_arm(arm: FloatingArm | None = None, stiff: bool | None = None) -> Equations:
    """The arm of seven joints on a base of 40 t: servo, friction and rotors of `snarelab.models.floating.space_arm`.

    Parameters
    ----------
    arm : FloatingArm or None
        The same arm with another tip, or with a mount on its base; None: `space_arm`.
    stiff : bool or None
        As `arm_equations` has it.
    """
    arm = space_arm() if arm is None else arm
    drive = space_arm_drive(arm)
    speeds = {f"speed_scale.{joint.name}": joint.speed for joint in arm.tree.joints}
    values, effects = {**drive.values, **speeds}, tuple(drive.effects)
    model = Model(
        Path(arm.tree.name), "space_arm", "free_floating_arm", None, arm.tree, "fixed", effects, {}, None, values
    )
    servo = ServoGains(np.asarray(drive.stiffness).tolist(), np.asarray(drive.damping).tolist())
    return arm_equations(model, arm, stiff, servo, CAPTURE_POSE)


ELEMENTS: dict[str, Callable[[], Equations]] = {
    "ets_vii_arm": ets_vii_arm,
    "joint_friction": joint_friction,
    "space_arm": station_arm,
    "suspended_target": suspended_target,
}
"""Self-contained models by name."""
