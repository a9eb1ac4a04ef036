"""Captures by MuJoCo's rods with one effect concealed, for a diagnosis that shares no dynamics code with them.

Rods, joints, ring and collision are those of `mujoco_rods`. How each effect gets there:

- ``contact_friction``: MuJoCo's own friction cone. ``cable_damping``: damping of the joints between rods.
- ``cable_pretension``: the rods do not stretch; a cable drawn by T over EA is shorter by that share.
- ``umbilical_stiffness``: springs on the target's three slides.
- ``hang_point_clearance``: the line is a force of its own here, with a hard dead zone.
- ``contact_stiffness`` and ``contact_damping``: MuJoCo's contacts scale with mass and cannot be given a stiffness per
  overlap. For these two, contacts between cables and pin are a penalty force where a smooth curve through the rods'
  joints touches the pin: Hertz's law with damping as Li et al. write it (eq. 19: K x^1.5 + C times the rate of x, never
  pulling) behind a stiff spring, which makes it Zener's solid, and Coulomb friction that sticks on a spring until it
  slips (Cundall and Strack 1979). The engine under test has Hunt and Crossley's law instead, and friction that never
  quite sticks.
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

STICK, BEHIND = 5e4, 1e5
"""[N/m] Of the spring on which a penalty contact sticks (it slips after some 0.01 mm), and of that behind its damper:
explicit steps of a tenth of a millisecond bear no stiffer ones, and no damper of that strength alone."""


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
    n_segments: int | None = None,
    step: float | None = None,
) -> Seen:
    """Simulate a capture of a target on a spring that keeps its orientation."""
    step = step or (1e-4 if truth.penalty else 4e-4)
    n_segments = n_segments or (20 if truth.penalty else 40)  # the curve through rods has no corners to touch with
    short = parameters.cable_length * (1 - truth.pretension / parameters.axial_stiffness)
    p = parameters.with_values(friction=truth.friction, bending_damping=truth.cable_damping, cable_length=short)
    model, data = _model(p, target, truth, n_segments, step)
    ring, pin = model.joint("ring").dofadr[0], model.joint("pin.x").dofadr[0]
    body = model.body("pin").id
    weight = target.mass * np.asarray(target.gravity)
    rods = np.array([[model.body(f"cable{c}").id + k for k in range(n_segments)] for c in range(3)])
    contact = None if truth.penalty is None else _Penalty(p, target, truth.penalty, n_segments, step)
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
    """Contact of cables with the shaft: where a smooth curve through the rods' joints is nearest to the shaft's axis.

    Rods alone would touch with their corners. The curve is Catmull and Rom's; the force acts on the rod beneath it.
    """

    def __init__(
        self, p: SnareParameters, target: Target, law: tuple[float, float], n_segments: int, step: float
    ) -> None:
        w, x, y, z = target.orientation
        axis = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])
        self._foot, self._axis = np.asarray(target.position, float), axis
        self._numbers = np.array([p.cable_radius + p.pin_radius, law[0], law[1], p.friction, p.pin_length, step])
        self._held = np.full((3, n_segments, 4), np.nan)

    def __call__(self, model: Any, data: Any, rods: Array, pin: int) -> Array:
        """Put the forces on the rods (3, n_segments); returns the force on the pin [N]."""
        foot = self._foot + data.qpos[model.nq - 3 :]
        velocity = data.qvel[pin : pin + 3].copy()
        flat = rods.ravel()
        joints = np.concatenate([data.xpos[rods], [[data.site(f"end{c}").xpos] for c in range(3)]], axis=1)
        forces, moments, total = _push(
            joints, data.xipos[flat], data.cvel[flat], data.subtree_com[model.body_rootid[flat]],
            foot, velocity, self._axis, self._numbers, self._held,
        )  # fmt: skip
        data.xfrc_applied[flat, :3], data.xfrc_applied[flat, 3:] = forces, moments
        return total


@numba.njit(cache=True)
def _curve(joints, k, u):
    """Point of the curve in segment k at u in 0 to 1, and its derivative by u."""
    last = joints.shape[0] - 1
    a, b = joints[k], joints[k + 1]
    ta = 0.5 * (b - joints[k - 1]) if k > 0 else b - a
    tb = 0.5 * (joints[k + 2] - a) if k + 2 <= last else b - a
    u2 = u * u
    u3 = u2 * u
    point = (2 * u3 - 3 * u2 + 1) * a + (u3 - 2 * u2 + u) * ta + (3 * u2 - 2 * u3) * b + (u3 - u2) * tb
    slope = (6 * u2 - 6 * u) * (a - b) + (3 * u2 - 4 * u + 1) * ta + (3 * u2 - 2 * u) * tb
    return point, slope


@numba.njit(cache=True)
def _climb(joints, k, u, foot, axis):
    """Derivative of the squared distance to the axis along the curve, halved."""
    point, slope = _curve(joints, k, u)
    out = point - foot - ((point - foot) @ axis) * axis
    return out @ slope


@numba.njit(cache=True)
def _push(joints, centres, twists, roots, foot, velocity, axis, numbers, held):
    """Forces and moments on the rods, force on the pin; ``held``: stretch of each rod's sticking spring [m], force
    of its damper [N]."""
    reach, stiffness, damping, friction, length, step = numbers
    n_segments = joints.shape[1] - 1
    n = centres.shape[0]
    forces, moments, total = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(3)
    before = held.copy()
    held[:] = np.nan
    for c in range(joints.shape[0]):
        cable = joints[c]
        for k in range(n_segments):
            from_foot = 0.5 * (cable[k] + cable[k + 1]) - foot
            aside = from_foot - (from_foot @ axis) * axis
            size = cable[k + 1] - cable[k]
            if np.sqrt(aside @ aside) > reach + np.sqrt(size @ size):
                continue
            for piece in range(2):
                low, high = 0.5 * piece, 0.5 * piece + 0.5
                if not (_climb(cable, k, low, foot, axis) < 0.0 <= _climb(cable, k, high, foot, axis)):
                    continue
                for _ in range(40):
                    middle = 0.5 * (low + high)
                    if _climb(cable, k, middle, foot, axis) < 0.0:
                        low = middle
                    else:
                        high = middle
                point, _ = _curve(cable, k, 0.5 * (low + high))
                along = (point - foot) @ axis
                out = point - foot - along * axis
                distance = np.sqrt(out @ out)
                overlap = reach - distance
                if along > 0.0 or along < -length or overlap <= 0.0:
                    continue
                i = c * n_segments + k
                normal = out / distance
                speed = twists[i, 3:] + np.cross(twists[i, :3], point - roots[i]) - velocity
                approach = -(speed @ normal)
                # A contact that has come from the next rod brings its springs along.
                state = np.zeros(4)
                for other in (k, k - 1, k + 1):
                    if 0 <= other < n_segments and not np.isnan(before[c, other, 0]):
                        state = before[c, other]
                        break
                fades = np.exp(-BEHIND * step / damping) if damping > 0.0 else 0.0
                damped = fades * state[3] + (1.0 - fades) * damping * approach
                push = max(stiffness * overlap**1.5 + damped, 0.0)
                stretch = state[:3] - (state[:3] @ normal) * normal + step * (speed + approach * normal)
                pull = STICK * np.sqrt(stretch @ stretch)
                if pull > friction * push:
                    stretch = stretch * (friction * push / pull)
                held[c, k, :3], held[c, k, 3] = stretch, damped
                force = push * normal - STICK * stretch
                forces[i] += force
                moments[i] += np.cross(point - centres[i], force)
                total -= force
    return forces, moments, total


def moved(target: Target, offset: Array) -> Target:
    """The target elsewhere at the start."""
    return replace(target, position=tuple(np.asarray(target.position) + offset))
