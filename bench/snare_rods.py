"""Captures by MuJoCo's rods with one effect concealed, for a diagnosis that shares no dynamics code with them.

Rods, joints, ring and collision are those of `mujoco_rods`. How each effect gets there:

- ``contact_friction``: MuJoCo's own friction cone. ``cable_damping``: damping of the joints between rods.
- ``cable_pretension``: the rods do not stretch; a cable drawn by T over EA is shorter by that share.
- ``umbilical_stiffness``: springs on the target's three slides.
- ``hang_point_clearance``: the line is a force of its own here, with a hard dead zone.
- ``contact_stiffness`` and ``contact_damping``: MuJoCo's contacts scale with mass and cannot be given a stiffness per
  overlap. For these two, contacts between cables and pin are a penalty force on the rods' capsules: Hertz's law with
  Kelvin and Voigt's damping as Li et al. write it (eq. 19: K x^1.5 + C times the rate of x, never pulling), and Coulomb
  friction, explicit, at a tenth of a millisecond. The engine under test has Hunt and Crossley's law instead.
"""

from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numba
import numpy as np
from numpy.typing import NDArray

from bench import mujoco_rods
from snarelab.models.snare.drive import ring_motion
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.settled import settled
from snarelab.models.snare.target import Target

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Truth:
    """What a capture has: friction [–], damping of the cables [s], pretension [N], umbilical [N/m], clearance [m]; a
    penalty contact's stiffness [N/m^1.5] and damping [N·s/m], or None for MuJoCo's own."""

    friction: float = 0.1
    cable_damping: float = 1e-3
    pretension: float = 0.0
    umbilical: float = 0.0
    clearance: float = 0.0
    penalty: tuple[float, float] | None = None


@dataclass(frozen=True)
class Seen:
    """Each step: time (n,) [s], position (n, 3) [m], force of the cables on the pin (n, 3) [N], ring (n,) [rad]."""

    time: Array
    position: Array
    force: Array
    angle: Array


def simulate(
    parameters: SnareParameters,
    target: Target,
    truth: Truth,
    duration: float = 10.0,
    n_segments: int = 20,
    step: float | None = None,
) -> Seen:
    """Simulate a capture of a target on a spring that keeps its orientation."""
    step = step or (1e-4 if truth.penalty else 2e-4)
    short = parameters.cable_length * (1 - truth.pretension / parameters.axial_stiffness)
    p = parameters.with_values(friction=truth.friction, bending_damping=truth.cable_damping, cable_length=short)
    model, data = _model(p, target, truth, n_segments, step)
    ring, pin = model.joint("ring").dofadr[0], model.joint("pin.x").dofadr[0]
    body = model.body("pin").id
    weight = target.mass * np.asarray(target.gravity)
    rods = np.array([[model.body(f"cable{c}").id + k for k in range(n_segments)] for c in range(3)]).ravel()
    contact = None if truth.penalty is None else _Penalty(p, target, truth.penalty, p.cable_length / n_segments)
    n = round(duration / step)
    position, force, angles = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    for k in range(n):
        angle, rate = ring_motion(k * step, p.ring_rate, p.ring_travel, p.ring_ramp)
        data.qpos[model.nq - 4], data.qvel[ring] = p.ring_direction * angle, p.ring_direction * rate
        pull = weight.copy()
        if truth.clearance > 0:
            pull += _line(target, truth.clearance, data.qpos[model.nq - 3 :])
        if contact is not None:
            mujoco.mj_forward(model, data)  # pyright: ignore[reportAttributeAccessIssue]
            pushed = contact(model, data, rods, pin)
            pull += pushed
        data.xfrc_applied[body, :3] = pull
        mujoco.mj_step(model, data)  # pyright: ignore[reportAttributeAccessIssue]
        position[k] = data.qpos[model.nq - 3 :]
        force[k] = data.qfrc_constraint[pin : pin + 3] if contact is None else pushed
        angles[k] = angle
    return Seen(step * np.arange(1.0, n + 1), position + np.asarray(target.position), force, angles)


def _model(p: SnareParameters, target: Target, truth: Truth, n_segments: int, step: float) -> tuple[Any, Any]:
    text = mujoco_rods._mjcf(p, target, n_segments, step)
    if truth.umbilical:
        text = text.replace('type="slide" axis=', f'type="slide" stiffness="{truth.umbilical}" axis=')
    if truth.clearance:
        text = text.replace(
            f'<spatial name="line" stiffness="{target.stiffness}"', '<spatial name="line" stiffness="0"'
        )
    if truth.penalty is not None:
        text = text.replace('contype="1" conaffinity="0"', 'contype="0" conaffinity="0"')
    model = mujoco.MjModel.from_xml_string(text)  # pyright: ignore[reportAttributeAccessIssue]
    data = mujoco.MjData(model)  # pyright: ignore[reportAttributeAccessIssue]
    mujoco_rods._bend(model, data, settled(p, n_segments)[:, :, 0])
    weight = target.mass * np.asarray(target.gravity)
    data.xfrc_applied[model.body("pin").id, :3] = 0.0 if truth.clearance else weight
    mujoco_rods._rest(model, data)
    return model, data


def _line(target: Target, clearance: float, moved: Array) -> Array:
    """Pull of the line on the target [N], its top free within the clearance."""
    gravity = np.asarray(target.gravity)
    down = gravity / np.linalg.norm(gravity)
    rest = target.line_length - target.mass * np.linalg.norm(gravity) / target.stiffness
    from_top = moved + target.line_length * down
    aside = from_top - (from_top @ down) * down
    distance = np.linalg.norm(aside)
    top = aside * min(1.0, clearance / max(distance, 1e-12))
    line = from_top - top
    length = np.linalg.norm(line)
    return -target.stiffness * (length - rest) * line / length


class _Penalty:
    """Contact of rods with the shaft: at each rod's point nearest to the shaft's axis, while it is beside the shaft."""

    def __init__(self, p: SnareParameters, target: Target, law: tuple[float, float], size: float) -> None:
        w, x, y, z = target.orientation
        axis = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])
        self._foot, self._axis = np.asarray(target.position, float), axis
        self._numbers = np.array([p.cable_radius + p.pin_radius, law[0], law[1], p.friction, size, p.pin_length])

    def __call__(self, model: Any, data: Any, rods: Array, pin: int) -> Array:
        """Put the forces on the rods; returns the force on the pin [N]."""
        foot = self._foot + data.qpos[model.nq - 3 :]
        velocity = data.qvel[pin : pin + 3].copy()
        twist = data.cvel[rods]
        forces, moments, total = _push(
            data.xpos[rods], data.xmat[rods], data.xipos[rods], twist, data.subtree_com[model.body_rootid[rods]],
            foot, velocity, self._axis, self._numbers,
        )  # fmt: skip
        data.xfrc_applied[rods, :3], data.xfrc_applied[rods, 3:] = forces, moments
        return total


@numba.njit(cache=True)
def _push(starts, turns, centres, twists, roots, foot, velocity, axis, numbers):
    reach, stiffness, damping, friction, size, length = numbers
    n = starts.shape[0]
    forces, moments, total = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(3)
    for i in range(n):
        along = np.ascontiguousarray(turns[i].reshape(3, 3)[:, 0])
        # The nearest points of two lines, the rod's inside the rod.
        between = starts[i] - foot
        a, b = along @ axis, between @ along
        c = between @ axis
        determinant = 1 - a * a
        s = (a * c - b) / determinant if determinant > 1e-9 else 0.0
        s = min(max(s, 0.0), size)
        point = starts[i] + s * along
        t = (point - foot) @ axis
        if t > 0.0 or t < -length:
            continue
        out = point - foot - t * axis
        distance = np.sqrt(out @ out)
        overlap = reach - distance
        if overlap <= 0.0:
            continue
        normal = out / distance
        speed = twists[i, 3:] + np.cross(twists[i, :3], point - roots[i]) - velocity
        approach = -(speed @ normal)
        push = max(stiffness * overlap**1.5 + damping * approach, 0.0)
        slip = speed + approach * normal
        rub = slip / np.sqrt(slip @ slip + 2.5e-7)
        force = push * (normal - friction * rub)
        forces[i] = force
        moments[i] = np.cross(point - centres[i], force)
        total -= force
    return forces, moments, total


def moved(target: Target, offset: Array) -> Target:
    """The target elsewhere at the start."""
    return replace(target, position=tuple(np.asarray(target.position) + offset))
