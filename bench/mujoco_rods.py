"""The snare again in MuJoCo: cables as chains of rods, contact by MuJoCo's own collision and contact code.

Nothing of our model is used but its dimensions, the ring's prescribed angle, and the shape of the cables at rest at
the start. A cable is ``n_segments`` equal capsules with ball joints between them, stiffness EI/Δs and damping τ EI/Δs,
straight when free of stress. The first turns freely about itself in a socket of next to no mass, which sits on the
fixed ring by a ball joint with the bearing's friction; the last is held on the rotating ring by a ``connect``
constraint. The ring is a very heavy body whose angle and rate are set before each step. Tension
is rigid here (ours strains by EA⁻¹: 3e-5 at 7 N), and so is contact (ours overlaps by 3 µm).

MuJoCo ≥ 3.13 is needed: its ``discrete`` integrator solves constraints in the metric M + hD + h²K, the others solve
them without the joints' damping, and then the connected ends fly off. ``solimp`` 0.9999 everywhere: the default 0.9 to
0.95 lets contact and connection creep.
"""

import time
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from snarelab.models.snare.drive import ring_motion
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.target import Target

Array = NDArray[np.float64]
STIFF = 'solimp="0.9999 0.9999 0.001 0.5 2"'


@dataclass(frozen=True)
class Capture:
    """What a simulated capture leaves: each step, and its cost.

    Parameters
    ----------
    time : (n_steps,)
        [s].
    position, force : (n_steps, 3)
        Of the pin's foot [m]; of the cables on the pin [N]. World frame.
    start : (3, n_segments + 1, 3)
        The cables at rest at the start [m].
    seconds : float
        CPU time of the steps alone [s].
    """

    time: Array
    position: Array
    force: Array
    start: Array
    seconds: float

    @property
    def first_contact(self) -> float:
        """When the cables first push the pin [s]; NaN if never."""
        touched = np.linalg.norm(self.force, axis=1) > 1e-6
        return float(self.time[np.argmax(touched)]) if touched.any() else np.nan


def capture(
    parameters: SnareParameters, target: Target, points: Array, duration: float = 10.0, step: float = 2e-4
) -> Capture:
    """Simulate with a target on a spring that keeps its orientation.

    Parameters
    ----------
    parameters : SnareParameters
        Without end stiffness, which these sockets do not have.
    target : Target
        On a spring.
    points : (3, n_segments + 1, 3)
        The cables at rest at the start, at equal distances along each [m].
    duration, step : float
        [s].
    """
    if parameters.end_stiffness or target.rotates or target.support != "spring":
        raise ValueError("the rods have no end stiffness, and a target on a spring that keeps its orientation")
    model = mujoco.MjModel.from_xml_string(_mjcf(parameters, target, points.shape[1] - 1, step))  # pyright: ignore[reportAttributeAccessIssue]
    data = mujoco.MjData(model)  # pyright: ignore[reportAttributeAccessIssue]
    _bend(model, data, points)
    data.xfrc_applied[model.body("pin").id, :3] = target.mass * np.asarray(target.gravity)  # none on the cables
    _rest(model, data)
    start = _points(model, data, points.shape[1] - 1)
    ring, pin = model.joint("ring").dofadr[0], model.joint("pin.x").dofadr[0]
    n_steps = round(duration / step)
    position, force = np.empty((n_steps, 3)), np.empty((n_steps, 3))
    begun = time.process_time()
    for k in range(n_steps):
        angle, rate = ring_motion(k * step, parameters.ring_rate, parameters.ring_travel, parameters.ring_ramp)
        data.qpos[model.nq - 4], data.qvel[ring] = parameters.ring_direction * angle, parameters.ring_direction * rate
        mujoco.mj_step(model, data)  # pyright: ignore[reportAttributeAccessIssue]
        position[k], force[k] = data.qpos[model.nq - 3 :], data.qfrc_constraint[pin : pin + 3]
    seconds = time.process_time() - begun
    times = step * np.arange(1.0, n_steps + 1)
    return Capture(np.asarray(times, float), position + np.asarray(target.position), force, start, seconds)


def _mjcf(p: SnareParameters, target: Target, n_segments: int, step: float) -> str:
    size = p.cable_length / n_segments
    mass, stiffness = p.mass_per_length * size, p.bending_stiffness / size
    inertia = f"{mass * p.cable_diameter**2 / 8} {mass * size**2 / 12} {mass * size**2 / 12}"
    rod = f"""<inertial pos="{size / 2} 0 0" mass="{mass}" diaginertia="{inertia}"/>
<geom class="cable%d" fromto="0 0 0 {size} 0 0"/>"""
    bend = f'<joint type="ball" stiffness="{stiffness}" damping="{p.bending_damping * stiffness}"/>'
    socket = f'<joint type="ball" damping="{p.end_friction}"/>'
    socket += '<inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/>'
    chains, ends, classes, holds = "", "", "", ""
    for c in range(3):
        start = 2 * np.pi / 3 * (1 - c)
        end = start + p.ring_direction * 2 * np.pi / 3
        cable = rod % c
        place = f"0 {p.ring_radius * np.cos(start)} {p.ring_radius * np.sin(start)}"
        chains += f'<body pos="{place}">{socket}<body name="cable{c}"><joint type="hinge" axis="1 0 0"/>'
        chains += cable + f'<body pos="{size} 0 0">{bend}{cable}' * (n_segments - 1)
        chains += f'<site name="end{c}" pos="{size} 0 0"/>' + "</body>" * (n_segments + 1)
        place = f"{p.ring_distance} {p.ring_radius * np.cos(end)} {p.ring_radius * np.sin(end)}"
        ends += f'<site name="ring{c}" pos="{place}"/>'
        holds += f'<connect site1="end{c}" site2="ring{c}" solref="{2 * step} 1" {STIFF}/>'
        own = 2 << c  # A cable touches the pin (bit 1) and the other cables, not itself.
        classes += f'<default class="cable{c}"><geom type="capsule" size="{p.cable_radius}" contype="{own}" '
        classes += f'conaffinity="{15 - own}"/></default>'
    above = np.asarray(target.position) - target.line_length * np.asarray(target.gravity) / np.linalg.norm(
        target.gravity
    )
    rest = target.line_length - target.mass * np.linalg.norm(target.gravity) / target.stiffness
    line = f'stiffness="{target.stiffness}" damping="{target.damping}" springlength="{rest}"'
    slides = "".join(
        f'<joint name="pin.{axis}" type="slide" axis="{direction}"/>'
        for axis, direction in (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1"))
    )
    neck = p.knob_length - p.pin_length
    return f"""<mujoco><option timestep="{step}" integrator="discrete" gravity="0 0 0" cone="elliptic" impratio="10"/>
<default><geom friction="{p.friction} 0 0" condim="3" solref="{2 * step} 1" {STIFF}/>{classes}</default>
<worldbody>{chains}<body name="ring">
<joint name="ring" type="hinge" axis="1 0 0"/>
<inertial pos="0 0 0" mass="1e6" diaginertia="1e6 1e6 1e6"/>{ends}</body>
<site name="above" pos="{_text(above)}"/>
<body name="pin" pos="{_text(target.position)}">{slides}<site name="foot"/>
<inertial pos="0 0 0" mass="{target.mass}" diaginertia="1 1 1"/>
<body quat="{_text(target.orientation)}"><inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>
<geom type="capsule" fromto="{neck} 0 0 0 0 0" size="{p.pin_radius}" contype="1" conaffinity="0"/>
<geom type="cylinder" fromto="{-p.pin_length} 0 0 {neck} 0 0" size="{p.knob_radius}" contype="1" conaffinity="0"/>
</body></body></worldbody>
<tendon><spatial name="line" {line}><site site="above"/><site site="foot"/></spatial></tendon>
<equality>{holds}</equality></mujoco>"""


def _text(values: object) -> str:
    return " ".join(f"{v:.17g}" for v in np.asarray(values))


def _bend(model: Any, data: Any, points: Array) -> None:
    """Turn each joint so that the chains follow the points, without twist (parallel transport)."""
    for c, cable in enumerate(points):
        address = model.jnt_qposadr[model.body_jntadr[model.body(f"cable{c}").id]]
        before, address = Rotation.identity(), address - 4  # the socket's, then one of the hinge's, then ball joints
        for i, span in enumerate(np.diff(cable, axis=0)):
            along, direction = before.as_matrix()[:, 0], span / np.linalg.norm(span)
            axis = np.cross(along, direction)
            sine = np.linalg.norm(axis)
            turn = Rotation.from_rotvec(axis * (np.arctan2(sine, along @ direction) / max(sine, 1e-300)))
            joint = before.inv() * turn * before
            here = address + 4 * i + (i > 0)
            data.qpos[here : here + 4] = joint.as_quat(scalar_first=True)
            before = turn * before


def _rest(model: Any, data: Any, duration: float = 0.3, step: float = 1e-3) -> None:
    """Let the rods find their own rest, strongly damped: it differs by some 0.01 mm from that of finer cables."""
    damping, usual = model.dof_damping.copy(), model.opt.timestep
    no_contact = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)  # pyright: ignore[reportAttributeAccessIssue]
    model.dof_damping *= 30
    model.opt.timestep = step
    model.opt.disableflags |= no_contact
    for _ in range(round(duration / step)):
        mujoco.mj_step(model, data)  # pyright: ignore[reportAttributeAccessIssue]
    model.dof_damping[:] = damping
    model.opt.timestep = usual
    model.opt.disableflags &= ~no_contact
    data.qvel[:] = 0.0
    data.time = 0.0


def _points(model: Any, data: Any, n_segments: int) -> Array:
    """Where the joints and the last ends of the three cables are, shape (3, n_segments + 1, 3)."""
    mujoco.mj_forward(model, data)  # pyright: ignore[reportAttributeAccessIssue]
    firsts = [model.body(f"cable{c}").id for c in range(3)]
    return np.array(
        [[*data.xpos[b : b + n_segments], data.site(f"end{c}").xpos] for c, b in enumerate(firsts)], dtype=float
    )
