"""The proof's own family of arms: straight tubes with a motor at each joint, three to six of them.

The arms that tests of the search draw (`bench.arm.random_arm`) are slender bodies of 2 to 20 kg that grow lighter
towards the tip, two or three of them. Here a link is 0.6 to 4 kg of tube and a motor of 0.4 to 3 kg, in any order,
longer, on a tilted foot, with a tool at the end, and friction follows what the joint carries.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bench.arm import Arm, Link
from bench.lugre import LuGre

N_JOINTS = (3, 3, 3, 3, 4, 4, 4, 5, 6)
"""Numbers of joints, each as often as it stands here."""


def random_robot(rng: np.random.Generator, n_joints: int) -> Arm:
    """Draw an arm of this family; links are tubes with a motor and a box each, so that inertia is physical."""
    links, last = [], -1
    for k in range(n_joints):
        axis = int(rng.choice([a for a in range(3) if a != last]))
        length, radius = rng.uniform(0.2, 0.7) * min(1.0, 3.5 / n_joints), rng.uniform(0.03, 0.06)
        parts = [
            (rng.uniform(0.4, 3.0), rng.normal(0.0, 0.03, 3)),
            (rng.uniform(0.1, 0.5), np.array([0.0, radius, length * rng.uniform(0.2, 0.8)])),
        ]
        if k == n_joints - 1:
            # A tool with a mass at either end, across the last axis, as a gripper and its camera.
            across = np.cross(np.eye(3)[axis], rng.normal(size=3))
            reach = across / np.linalg.norm(across) * rng.uniform(0.18, 0.3)
            parts += [(rng.uniform(1.0, 2.5), reach), (rng.uniform(1.0, 2.5), -reach)]
        tube, middle = rng.uniform(0.6, 4.0), np.array([0.0, 0.0, length / 2.0])
        mass = tube + sum(m for m, _ in parts)
        com = (tube * middle + sum(m * p for m, p in parts)) / mass
        slender = tube * (radius**2 / 2.0 + length**2 / 12.0)
        inertia = np.diag([slender, slender, tube * radius**2]) + point_inertia(tube, middle - com)
        inertia += sum(point_inertia(m, p - com) + 0.4 * m * 0.05**2 * np.eye(3) for m, p in parts)
        before = links[-1][1] if links else rng.uniform(0.1, 0.4)
        sideways = rng.uniform(-0.12, 0.12) if links else 0.0
        link = Link(
            kind="revolute",
            origin=np.array([sideways, 0.0, before]),
            rpy=rng.uniform(-0.3, 0.3, 3) if k == 0 else rng.choice([-1.0, 0.0, 1.0], 3) * rng.uniform(0.0, 0.8, 3),
            axis=np.eye(3)[axis],
            mass=float(mass),
            com=com,
            inertia=inertia,
            travel=float(rng.uniform(0.9, 1.9)),
            speed=float(rng.uniform(0.8, 2.5)),
        )
        links.append((link, length))
        last = axis
    return Arm(tuple(link for link, _ in links))


def random_friction(rng: np.random.Generator, arm: Arm, peak: NDArray) -> dict[str, LuGre]:
    """Friction of every joint: 4 to 30 % of its ``peak`` torque (n_joints,), from 0.3 to 6 N·m.

    Viscous shares and the travel of the bristles are wider than the tuning set's.
    """
    return {
        joint: LuGre(
            level=(level := float(np.clip(top * np.exp(rng.uniform(*np.log((0.04, 0.3)))), 0.3, 6.0))),
            viscous=level * float(rng.uniform(0.2, 1.4)),
            deflection=float(np.exp(rng.uniform(np.log(2e-4), np.log(1.5e-3)))),
        )
        for joint, top in zip(arm.joints, peak, strict=True)
    }


def point_inertia(mass: float, arm: NDArray) -> NDArray:
    """Inertia (3, 3) [kg·m²] of a point mass at ``arm`` [m], about the origin."""
    return mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))


def by_joint(arm: Arm, value: float) -> Mapping[str, float]:
    """One number for every joint."""
    return dict.fromkeys(arm.joints, value)
