"""How much of gravity the rig takes off each joint, the forces in its hang units, and the paper's friction law.

The unloading ratio is the paper's title; it prints no number for it, and the definition it refers to (Li, Shao, Tian
and Tang, *Robot* 38, 2016) was not at hand. Ours: of the moment that a joint would bear from the weight of everything
beyond it if no sling held the arm, the share that does not show in the joint's torque as a departure from the same
motion in orbit,

    u_j = 1 − mean|τ_j − τ_j,orbit| / mean|M_j|,

M_j being the whole moment of that weight about the joint's origin: of seven joints five turn about the vertical, and
gravity has no moment about their axes at all.
"""

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from ...models.effects import get_effect
from ...models.hidden_state import evaluate_law
from ...models.inertia import Array
from ...models.rig.rig import BAR, PLATE, ROD, Rig, hang_unit_loads
from ...models.tree import Tree

PRINTED = {"gamma1": 0.5, "gamma2": 100.0, "gamma3": 50.0, "gamma4": 0.1, "gamma5": 100.0, "gamma6": 0.05}
"""The paper's parameters of its figure 5."""


def printed_law(speed: Array) -> dict[str, Array]:
    """Equation 11 as printed, with the printed parameters: f and its three parts, each of the speeds' shape."""
    g = PRINTED
    parts = {
        "f1": g["gamma1"] * (np.tanh(g["gamma2"] * speed) - np.tanh(g["gamma3"] * speed)),
        "f2": g["gamma4"] * np.tanh(g["gamma5"] * speed),
        "f3": g["gamma6"] * speed,
    }
    return {"f": parts["f1"] + parts["f2"] + parts["f3"], **parts}


def registered_law(speed: Array) -> Array:
    """The printed friction by the vocabulary's `makkar_friction`, whose parameters are speeds and levels."""
    g = PRINTED
    values = {
        "stribeck_level": g["gamma1"],
        "stribeck_speed": 1 / g["gamma2"],
        "stribeck_ratio": g["gamma2"] / g["gamma3"],
        "coulomb_level": g["gamma4"],
        "coulomb_speed": 1 / g["gamma5"],
        "viscous_coefficient": g["gamma6"],
    }
    effect = get_effect("makkar_friction")
    given = np.array([values[p.name] for p in effect.parameters])
    return evaluate_law(effect, {"qd": speed}, given).values[:, 0]


def gravity_moments(tree: Tree, q: Array) -> Array:
    """Size of the weight's moment about each joint's origin, of all links beyond it (n, J) [N·m]; q (n, J)."""
    n, places, turns = len(q), [], []
    for k, joint in enumerate(tree.joints):
        at = np.zeros((n, 3)) if joint.parent < 0 else places[joint.parent]
        turn = Rotation.identity(n) if joint.parent < 0 else turns[joint.parent]
        places.append(at + turn.apply(joint.translation))
        turns.append(turn * Rotation.from_matrix(joint.rotation) * Rotation.from_rotvec(np.outer(q[:, k], joint.axis)))
    moments = np.zeros((n, len(places), 3))
    for k, link in enumerate(tree.links):
        mass = float(link.phi[0])
        if not mass:
            continue
        centre = places[k] + turns[k].apply(link.phi[1:4] / mass)
        carrier = k
        while carrier >= 0:
            moments[:, carrier] += np.cross(centre - places[carrier], mass * tree.gravity)
            carrier = tree.joints[carrier].parent
    return np.linalg.norm(moments, axis=2)


def unloading_ratio(tree: Tree, q: Array, measured: Array, orbit: Array) -> Array:
    """u (J,) of torques measured on the rig and those of the same motion in orbit, each (n, J) [N·m]."""
    return 1.0 - np.abs(measured - orbit).mean(axis=0) / gravity_moments(tree, q).mean(axis=0)


def unit_forces(rig: Rig) -> dict[str, Mapping[str, float]]:
    """N_A, N_B, N_C + N_D and N_C + N_F of every hang unit [N] (eq. 12), and each alone where halves are equal.

    The equation leaves how rods and contacts share open: on a plate and a slide that are symmetric each has half.
    """
    found = {}
    for sling in rig.slings:
        loads = hang_unit_loads(sling.weight, ROD, PLATE, BAR)
        found[sling.name] = {
            "N_A": loads.bar,
            "N_B": loads.plate,
            "N_C + N_D": loads.rods,
            "N_C + N_F": loads.joint,
            "N_C": loads.rods / 2,
            "N_D": loads.rods / 2,
            "N_F": loads.joint - loads.rods / 2,
        }
    return found
