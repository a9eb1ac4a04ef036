"""A link that bends or twists, for ``machine_effects``: hinges with springs at its far end, in MuJoCo."""

# pyright: reportAttributeAccessIssue=false
from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

from .concealed import Planned, Rng
from .parts import Beam

SOFT = 1e-4
"""A compliance [rad/(N·m)] so small that the torque it changes is linear in it."""

RINGS = 5.0
"""Frequency [Hz] below which no link may ring: a servo would feel it."""


def beam(part: str, axes: tuple[int, ...]) -> Callable[[Planned, float, Rng], tuple[str, float, Beam]]:
    """Link, stiffness [N·m/rad] and part of a link that turns about ``axes``, sized as `Planned.amount` does."""

    def make(m: Planned, rms: float, rng: Rng) -> tuple[str, float, Beam]:
        number = min(m.joint, len(m.arm.links) - 2) + 1
        link = f"link{number}"
        rigid, moment, inertia = _needed(m, link, axes, np.zeros((len(m.q), len(axes))))
        bent, _, _ = _needed(m, link, axes, -SOFT * moment)
        most = 1.0 / ((2.0 * np.pi * RINGS) ** 2 * inertia)
        stiffness = 1.0 / m.amount((bent - rigid) / SOFT, rms, most)
        return link, stiffness, Beam(**{part: stiffness}, damping=float(rng.uniform(5e-4, 2e-3)) * stiffness)

    return make


def _needed(m: Planned, link: str, axes: tuple[int, ...], turns: NDArray) -> tuple[NDArray, NDArray, float]:
    """Torque of the joints (n_samples, n_joints) and of the hinges (n_samples, n_axes) along the plan and these turns;
    the hinges' largest inertia at rest."""
    text = m.arm.mjcf(turns={link: dict.fromkeys(axes, "")})
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    joints = [model.joint(j).dofadr[0] for j in m.arm.joints]
    hinges = [model.joint(f"{link}_turn{a}").dofadr[0] for a in axes]
    rate = np.gradient(turns, m.period, axis=0)
    moves = zip(m.q, m.qd, m.qdd, turns, rate, np.gradient(rate, m.period, axis=0), strict=True)
    found = np.empty((len(m.q), model.nv))
    for k, (q, qd, qdd, x, xd, xdd) in enumerate(moves):
        data.qpos[joints], data.qvel[joints], data.qacc[joints] = q, qd, qdd
        data.qpos[hinges], data.qvel[hinges], data.qacc[hinges] = x, xd, xdd
        mujoco.mj_inverse(model, data)
        found[k] = data.qfrc_inverse
    full = np.zeros((model.nv, model.nv))
    unit = np.eye(model.nv)
    for k in range(model.nv):
        mujoco.mj_mulM(model, data, full[k], unit[k])
    return found[:, joints], found[:, hinges], float(max(full[h, h] for h in hinges))
