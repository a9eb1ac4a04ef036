"""A docking test again in MuJoCo: balls in grooves by its own collision code, cables and latches as tendons.

Nothing of our model is used but the dimensions. A ball is a sphere, a groove two boxes for its flanks and two for the
land beside them; a sphere's centre follows an edge rounded by its radius, so that spheres of the edge's radius meet
boxes set back by it. MuJoCo's contact is a spring whose stiffness is normalised by mass, F = k δ / ((1 − d) A), A the
inverse mass that it compiles for the bodies, d the impedance: k is chosen for the flanks' stiffness. The mount is its
joints' springs, the cables a tendon that bears beyond its length, a latch a tendon whose spring has a dead band, and an
actuator for its preload. The carriage has its own mass, dry friction and position loop. Friction is MuJoCo's soft
constraint, which creeps, by a hundredth with `held` a hundred times as large; its own remedy (`noslip`) makes seats jam
that statics says do not.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
mj: Any = mujoco
IMPEDANCE = 0.95
"""d of every contact."""
LOOP = 5e6, 2e4
"""Stiffness and damping of the carriage's position loop [N/m, N·s/m]."""
ROTOR = 2e-5 * (2 * np.pi / 0.005) ** 2
"""Of motor and screw, as a mass of the carriage [kg]."""
_HALF = 0.04
ANGLES = np.pi / 2 + 2 * np.pi / 3 * np.arange(3)
"""Of the grooves about the axis, from y towards z [rad]."""
EVERY = 4
"""Steps between two samples."""


@dataclass(frozen=True)
class Truth:
    """Everything that is in a docking test, in SI units; see `DockingParameters` and `Bench` for what is meant."""

    friction: float = 0.15
    dry: float = 20.0
    viscous: float = 200.0
    offsets: tuple[float, float, float] = (0.0, 0.0, 0.0)
    play: float = 0.0
    lost: float = 0.0
    lost_time: float = 5.0
    radius: float = 0.15
    seat: float = 0.08
    flank: float = np.pi / 4
    half_width: float = 0.02
    edge: float = 0.005
    stiffness: float = 1e7
    front: float = 0.10
    bumper_radius: float = 0.11
    bumper_stiffness: float = 1e6
    latch_stiffness: float = 5e7
    latch_damping: float = 3e4
    latch_preload: float = 1000.0
    carriage_mass: float = 15.0
    mass: float = 120.0
    inertia: tuple[float, float, float] = (6.0, 10.0, 10.0)
    mount: tuple[float, float] = (3000.0, 900.0)
    turning: tuple[float, float] = (600.0, 120.0)
    knob: float = 0.26
    ring: float = 0.15
    slack: float = 0.015
    cable: tuple[float, float] = (4e5, 2000.0)
    damping: float = 0.6  # of contacts, as a ratio
    held: float = 1e3  # how much harder friction holds than a contact (`impratio`): the more, the less it creeps


@dataclass
class Seen:
    """What a run leaves, a row a sample: time [s], travel and the motor's force [m, N], place [m], quaternion, force
    and torque on the target [N, N·m], pull of each latch [N], and how far the latches have closed."""

    time: list[float] = field(default_factory=list)
    travel: list[float] = field(default_factory=list)
    motor: list[float] = field(default_factory=list)
    place: list[Array] = field(default_factory=list)
    quaternion: list[Array] = field(default_factory=list)
    force: list[Array] = field(default_factory=list)
    torque: list[Array] = field(default_factory=list)
    pull: list[Array] = field(default_factory=list)
    closed: list[float] = field(default_factory=list)


def simulate(
    truth: Truth,
    command: Callable[[float], float],
    duration: float,
    place: Array,
    turn: Rotation,
    latch: tuple[float, float],
    step: float = 1e-4,
) -> Seen:
    """Run a docking test.

    Parameters
    ----------
    truth : Truth
    command : callable
        Travel that the carriage's loop is told [m], by time.
    duration : float
        [s]
    place, turn :
        The end effector's pose at the start, at rest in its mount [m].
    latch : tuple of two floats
        When the latches begin to close, and when they are closed [s].
    step : float
        [s]
    """
    model = mj.MjModel.from_xml_string(mjcf(truth, place, turn, command(0.0), step))
    harden(model, truth)
    data = mj.MjData(model)
    data.qpos[int(model.joint("carriage").qposadr[0])] = command(0.0)
    mj.mj_forward(model, data)
    body = mj.mj_name2id(model, mj.mjtObj.mjOBJ_BODY, "effector")
    balls = [mj.mj_name2id(model, mj.mjtObj.mjOBJ_SITE, f"ball{i}") for i in range(3)]
    held = [mj.mj_name2id(model, mj.mjtObj.mjOBJ_SITE, f"held{i}") for i in range(3)]
    holds = [mj.mj_name2id(model, mj.mjtObj.mjOBJ_TENDON, f"latch{i}") for i in range(3)]
    cable = mj.mj_name2id(model, mj.mjtObj.mjOBJ_TENDON, "cable")
    slide = model.joint("carriage")
    s_at, s_dof = int(slide.qposadr[0]), int(slide.dofadr[0])
    knob = np.array([-truth.knob, 0.0, 0.0])
    ring = mj.mj_name2id(model, mj.mjtObj.mjOBJ_SITE, "ring")
    seen, wrench, left = Seen(), np.zeros(6), truth.latch_preload
    taken, share = False, 0.0

    def look(time: float) -> None:
        data.ctrl[0] = command(time)
        mj.mj_forward(model, data)
        on, about = np.zeros(3), np.zeros(3)
        for k in range(data.ncon):
            contact = data.contact[k]
            mj.mj_contactForce(model, data, k, wrench)
            # The frame's x points from the first geom to the second, on which the force is.
            force = (
                contact.frame.reshape(3, 3).T @ wrench[:3] * (1.0 if model.geom_bodyid[contact.geom2] == 0 else -1.0)
            )
            on += force
            about += _cross(contact.pos, force)
        drawn = data.site_xpos[ring] - knob
        length = float(np.linalg.norm(drawn))
        bearing = model.tendon_stiffness[cable] > 0
        tension = truth.cable[0] * (length - truth.slack) + truth.cable[1] * float(data.ten_velocity[cable])
        pull = max(tension, 0.0) * drawn / length if bearing else np.zeros(3)
        on += pull
        about += _cross(knob, pull)
        pulls = np.zeros(3)
        if taken:
            for i, (b, h, t) in enumerate(zip(balls, held, holds, strict=True)):
                away = data.site_xpos[b] - model.site_pos[h]
                d = max(float(np.linalg.norm(away)), 1e-12)
                spring = model.tendon_stiffness[t] * max(d - truth.play / 2, 0.0)
                spring += model.tendon_damping[t] * float(data.ten_velocity[t])
                grip = -spring * away / d + [data.ctrl[1 + i], 0.0, 0.0]
                pulls[i] = grip[0]
                on -= grip
                about -= _cross(data.site_xpos[b], grip)
        seen.time.append(time)
        seen.travel.append(float(data.qpos[s_at]))
        seen.motor.append(float(data.qfrc_actuator[s_dof]))
        seen.place.append(data.xpos[body].copy())
        seen.quaternion.append(data.xquat[body].copy())
        seen.force.append(on)
        seen.torque.append(about)
        seen.pull.append(pulls)
        seen.closed.append(share)

    for k in range(round(duration / step)):
        time = k * step
        share = min(max((time - latch[0]) / (latch[1] - latch[0]), 0.0), 1.0)
        if share > 0:
            if not taken:
                taken = True
                model.site_pos[held] = data.site_xpos[balls]
            # A Maxwell element: what is left of the preload relaxes to what stays.
            left += step / truth.lost_time * ((1 - truth.lost) * truth.latch_preload - left)
            model.tendon_stiffness[holds] = share * truth.latch_stiffness
            model.tendon_damping[holds] = share * truth.latch_damping
            data.ctrl[1:4] = share * left
        data.ctrl[0] = command(time)
        # MuJoCo has no spring that bears on one side of a point: a cable draws only towards the target.
        away = data.site_xpos[ring] - knob
        bears = float(away @ data.xmat[body, ::3]) < 0 and float(away @ away) > truth.slack**2
        model.tendon_stiffness[cable], model.tendon_damping[cable] = truth.cable if bears else (0.0, 0.0)
        mj.mj_step(model, data)
        if (k + 1) % EVERY == 0:
            look(float(data.time))
    return seen


def _cross(a: Array, b: Array) -> Array:
    """NumPy's own takes most of a run's time."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def harden(model: Any, truth: Truth) -> None:
    """Give every contact the stiffness that is asked for; see the module."""
    body = mj.mj_name2id(model, mj.mjtObj.mjOBJ_BODY, "effector")
    carriage = mj.mj_name2id(model, mj.mjtObj.mjOBJ_BODY, "carriage")
    for g in range(model.ngeom):
        name = mj.mj_id2name(model, mj.mjtObj.mjOBJ_GEOM, g)
        if name.startswith(("bumper", "face")):
            a, k = float(model.body_invweight0[carriage][0]), truth.bumper_stiffness
        else:
            a, k = float(model.body_invweight0[body][0]), truth.stiffness
        pace = k * (1 - IMPEDANCE) * a
        model.geom_solref[g] = [-pace, -2 * truth.damping * np.sqrt(pace)]
        model.geom_solimp[g] = [IMPEDANCE, IMPEDANCE, 1e-3, 0.5, 2]


def mjcf(truth: Truth, place: Array, turn: Rotation, travel: float, step: float, paired: str = "") -> str:
    """The test as MuJoCo reads it; ``paired`` are contacts with values of their own."""
    t, lines = truth, []
    s, c, r = np.sin(t.flank), np.cos(t.flank), t.edge
    for i in range(3):
        a = float(ANGLES[i])
        radial, lateral = np.array([0, np.cos(a), np.sin(a)]), np.array([0, -np.sin(a), np.cos(a)])
        for side in (1.0, -1.0):
            across, middle = side * lateral, t.radius * radial + t.offsets[i] * lateral
            inward = np.array([s, 0, 0]) + c * across  # into the flank's solid
            along = np.array([-c, 0, 0]) + s * across  # along the flank, out of the groove
            corner_x = r - t.half_width * c / s
            corner = np.array([corner_x, 0, 0]) + (r - s * corner_x) / c * across + middle
            # A flank ends at the corner and begins below the seat; the land goes on from the corner outwards.
            length = 2 * t.half_width / s
            flank = corner - 0.5 * length * along + _HALF * inward
            lines.append(_box(f"flank{i}{'+' if side > 0 else '-'}", flank, inward, along, _HALF, 0.5 * length))
            land = corner + _HALF * across + _HALF * np.array([1.0, 0, 0])
            lines.append(_box(f"land{i}{'+' if side > 0 else '-'}", land, np.array([1.0, 0, 0]), across, _HALF, _HALF))
    lines.append('<geom name="face" type="box" pos="0.05 0 0" size="0.05 0.13 0.13" contype="2" conaffinity="2"/>')
    w, x, y, z = turn.as_quat(scalar_first=True)

    def at(depth: float, radius: float, i: int) -> str:
        return f"{depth} {radius * np.cos(ANGLES[i]):.17g} {radius * np.sin(ANGLES[i]):.17g}"

    balls = "".join(
        f'<geom name="ball{i}" type="sphere" size="{r}" pos="{at(t.seat, t.radius, i)}" friction="{t.friction}"/>'
        f'<site name="ball{i}" pos="{at(t.seat, t.radius, i)}"/>'
        for i in range(3)
    )
    bumpers = "".join(
        f'<geom name="bumper{i}" type="sphere" size="0.005" pos="{at(t.front - 0.005, t.bumper_radius, i)}" '
        'contype="2" conaffinity="2" condim="1"/>'
        for i in range(3)
    )
    p = " ".join(f"{v:.17g}" for v in place)
    own = np.array(t.inertia)
    latches = "".join(
        f'<spatial name="latch{i}" springlength="0 {t.play / 2}"><site site="held{i}"/><site site="ball{i}"/></spatial>'
        for i in range(3)
    )
    preloads = "".join(
        f'<general site="ball{i}" refsite="held{i}" gear="1 0 0 0 0 0" gaintype="fixed" gainprm="1"/>' for i in range(3)
    )
    return f"""<mujoco><option timestep="{step}" gravity="0 0 0" integrator="implicitfast" cone="elliptic"
 impratio="{t.held}" iterations="50" tolerance="1e-12"/>
<default><geom condim="3" friction="{t.friction} 0 0"/></default>
<worldbody>{"".join(lines)}
<site name="knob" pos="{-t.knob} 0 0"/>{"".join(f'<site name="held{i}" pos="-1 0 0"/>' for i in range(3))}
<body name="effector" pos="{p}" quat="{w:.17g} {x:.17g} {y:.17g} {z:.17g}">
<joint name="mx" type="slide" axis="{_row(turn, 0)}" stiffness="{t.mount[0]}" damping="{t.mount[1]}"/>
<joint name="my" type="slide" axis="{_row(turn, 1)}" stiffness="{t.mount[0]}" damping="{t.mount[1]}"/>
<joint name="mz" type="slide" axis="{_row(turn, 2)}" stiffness="{t.mount[0]}" damping="{t.mount[1]}"/>
<joint name="mr" type="ball" stiffness="{t.turning[0]}" damping="{t.turning[1]}"/>
<inertial pos="0 0 0" mass="{t.mass - t.carriage_mass}" diaginertia="{own[0]} {own[1]} {own[2]}"/>{balls}
<body name="carriage"><joint name="carriage" type="slide" axis="-1 0 0" ref="0" armature="{ROTOR}"
 frictionloss="{t.dry}" solimpfriction="0.9999 0.9999 0.001 0.5 2" damping="{t.viscous}"/>
<inertial pos="0 0 0" mass="{t.carriage_mass}" diaginertia="0.001 0.001 0.001"/>
<site name="ring" pos="{-t.ring} 0 0"/>{bumpers}</body></body></worldbody>
<contact>{paired}</contact>
<tendon><spatial name="cable" springlength="0 {t.slack}"><site site="knob"/><site site="ring"/></spatial>
{latches}</tendon>
<actuator><position joint="carriage" kp="{LOOP[0]}" kv="{LOOP[1]}"/>{preloads}</actuator>
</mujoco>"""


def _row(turn: Rotation, i: int) -> str:
    """World axis i in the body's frame: MuJoCo takes a joint's axis there."""
    return " ".join(f"{v:.17g}" for v in turn.as_matrix()[i])


def _box(name: str, centre: Array, inward: Array, along: Array, deep: float, half: float) -> str:
    """A box whose face looks against ``inward``, long ``along`` it."""
    third = np.cross(inward, along)
    q = Rotation.from_matrix(np.column_stack([inward, along, third])).as_quat(scalar_first=True)
    place, quat = (" ".join(f"{v:.17g}" for v in x) for x in (centre, q))
    return f'<geom name="{name}" type="box" pos="{place}" quat="{quat}" size="{deep} {half:.17g} 0.04"/>'
