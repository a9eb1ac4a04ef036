"""What each effect should do, worked out without its law: closed forms, integrators, theorems."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from effect_signals import (
    BEYOND,
    DT,
    TIME,
    hang_point,
    inertial_parameters,
    load,
    shaken,
    spin,
    told,
    transmitted,
    value,
)
from scipy.integrate import solve_ivp
from scipy.signal import lsim
from scipy.spatial.transform import Rotation

from snarelab.models.snare import law as contact_law


@dataclass(frozen=True)
class Reference:
    """True parameters by name, and what is measured with them: ``output(signals, *their values)``."""

    truth: dict[str, float]
    output: Callable[..., np.ndarray]
    tolerance: float = 0.02  # on each parameter, relative to its true value
    settle: float = 0.0  # s left out where states start: what was before (of what leads: after) is not recorded
    likeness: float = 2e-3  # share of its size by which the law may be off: what a rounded corner costs


def both_directions(s, level_difference, coefficient_difference):
    speed = np.abs(s["qd"])
    forward = (5 + level_difference / 2) + (2 + coefficient_difference / 2) * speed
    backward = (5 - level_difference / 2) + (2 - coefficient_difference / 2) * speed
    return np.where(s["qd"] > 0, forward, -backward) - np.sign(s["qd"]) * (5 + 2 * speed)


def gaussian_bump(s, level, speed):
    return level * np.sign(s["qd"]) * np.power(np.e, -np.square(s["qd"] / speed))


def exponential_tanh(x):
    return 1 - 2 / (np.exp(2 * np.clip(x, -300, 300)) + 1)


def makkar(s, stribeck_level, stribeck_speed, stribeck_ratio, coulomb_level, coulomb_speed, viscous):
    steep, shallow, slope = 1 / stribeck_speed, 1 / (stribeck_ratio * stribeck_speed), 1 / coulomb_speed
    bump = stribeck_level * (exponential_tanh(steep * s["qd"]) - exponential_tanh(shallow * s["qd"]))
    return bump + coulomb_level * exponential_tanh(slope * s["qd"]) + viscous * s["qd"]


def rung(driven, frequency, damping):
    """Relative acceleration of an oscillator on a ground that accelerates (n, 3), by SciPy's state-space matrices."""
    w = 2 * np.pi * frequency
    system = ([[0, 1], [-(w**2), -2 * damping * w]], [[0], [-1]], [[-(w**2), -2 * damping * w]], [[-1]])
    return np.stack([lsim(system, x, TIME)[1] for x in driven.T], axis=1)


def bending_panels(s, inertia_x, inertia_y, inertia_z, frequency, damping):
    """Moment of three rotors on springs, about one axis each."""
    moment = -rung(s["spin_rate"], frequency, damping) * [inertia_x, inertia_y, inertia_z]
    return np.hstack([np.zeros_like(moment), moment])


def mass_in_a_tank(s, mass, _y, _z, *rest):
    """A ball on a spring, followed in the world frame: what it does to the base beyond a ball that is fixed there."""
    tank, frequency, damping = np.array(rest[:3]), *rest[3:]
    w = 2 * np.pi * frequency

    def pulled(time, state):
        """Place and acceleration of the ball along the base's axes."""
        back = Rotation.from_quat(state[:4]).inv()
        away, fast = back.apply(state[10:13] - state[4:7]), back.apply(state[13:] - state[7:10])
        return away, -(w**2) * (away - tank) - 2 * damping * w * (fast - np.cross(spin(time), away))

    def rate(time, state):
        turned, turning = Rotation.from_quat(state[:4]), np.array([*spin(time), 0.0])
        x, y, z, u = state[:4]
        product = np.array([[u, -z, y, x], [z, u, -x, y], [-y, x, u, z], [-x, -y, -z, u]]) @ turning
        pushed, ball = turned.apply(shaken(np.array([time]))[1, 0]), turned.apply(pulled(time, state)[1])
        return np.concatenate([product / 2, state[7:10], pushed, state[13:], ball])

    start = np.concatenate([[0, 0, 0, 1], np.zeros(6), tank, np.zeros(3)])
    run = solve_ivp(rate, TIME[[0, -1]], start, t_eval=TIME, rtol=1e-8, atol=1e-10).y.T
    away, ball = (np.array(x) for x in zip(*map(pulled, TIME, run), strict=True))
    fixed = s["acceleration"] + np.cross(s["spin_rate"], tank) + np.cross(s["spin"], np.cross(s["spin"], tank))
    return mass * np.hstack([fixed - ball, np.cross(tank, fixed) - np.cross(away, ball)])


def turning_wheels(s, loss_x, loss_y, loss_z, coulomb_x, coulomb_y, coulomb_z, inertia):
    """Three wheels by their speeds in the base; what they keep from their motors' impulse turns with it."""
    viscous, coulomb = inertia * np.array([loss_x, loss_y, loss_z]), np.array([coulomb_x, coulomb_y, coulomb_z])

    def drag(speed):
        return viscous * speed + coulomb * np.clip(speed / 1e-3, -1, 1)

    def rate(time, speed):
        return -shaken(np.array([time]))[0, 0] - (told(time)[1] + drag(speed)) / inertia

    speed = solve_ivp(rate, TIME[[0, -1]], np.zeros(3), "Radau", TIME, rtol=1e-8, atol=1e-9).y.T
    kept = inertia * (speed + spin(TIME)) + told(TIME)[0]
    moment = drag(speed) - np.cross(spin(TIME), kept)
    return np.hstack([np.zeros_like(moment), moment])


def steady_moment(s, x, y, z):
    """Two equal and opposite forces on arms of 1 m for each axis."""
    arms, forces = np.eye(3), np.array([[0, z, 0], [0, 0, x], [y, 0, 0]]) / 2
    moment = sum(
        np.cross(side * arm, side * force) for side in (1, -1) for arm, force in zip(arms, forces, strict=True)
    )
    return np.tile(np.concatenate([np.zeros(3), moment]), (TIME.size, 1))


def late_friction(s, level, travel, by_load):
    """Dahl's equation for the force: as stiff with load as without, and as strong as the load has it."""
    stiffness, sign = level / travel, np.sign(s["qd"])
    most = level * (1 + by_load * np.abs(s["load"]))

    def rate(time, force):
        speed = np.interp(time, TIME, s["qd"])
        return stiffness * (speed - np.abs(speed) * force / np.interp(time, TIME, most))

    force = solve_ivp(rate, TIME[[0, -1]], [most[0] * sign[0]], "LSODA", TIME, rtol=1e-8, atol=1e-8, max_step=DT).y[0]
    return force - most * sign


def friction_table(s, cosine, sine, period):
    grid = np.linspace(0, 1, 2001)
    amplitude, lead = np.hypot(cosine, sine), np.arctan2(sine, cosine) / (2 * np.pi)
    level = np.interp(s["q"] / period % 1, grid, amplitude * np.cos(2 * np.pi * (grid - lead)))
    return level * np.sign(s["qd"])


def spring(s, stiffness, torque_at_zero):
    return np.interp(s["q"], [-9, 9], [torque_at_zero - 9 * stiffness, torque_at_zero + 9 * stiffness])


def ripple(s, cosine, sine, period):
    return np.real((cosine - 1j * sine) * np.exp(2j * np.pi * s["q"] / period))


def by_quadrant(s, driving_loss, braking_loss):
    """What a motor supplies by the efficiency of its gear in each quadrant, less what the load asks for."""
    driven = s["load"] / (1 / (1 + driving_loss))
    held_back = s["load"] * (1 - braking_loss)
    return np.where(np.sign(s["load"]) == np.sign(s["qd"]), driven, held_back) - s["load"]


def saturated(s, excess, knee, no_load_speed):
    """Logged torque by a table: one for one between a motor's lines from stall to no-load speed, steeper outside."""
    shift = knee * s["qd"] / no_load_speed
    x = s["value"] + shift
    far = 50.0
    table = [-far * (1 + excess) + excess * knee, -knee, knee, far * (1 + excess) - excess * knee]
    return np.interp(x, [-far, -knee, knee, far], table) - shift


def warmed(s, fall, per_kelvin, time):
    """Newton's cooling of what friction heats, by SciPy's linear system."""
    warmth = lsim(([[-1 / time]], [[1 / time]], [[1.0]], [[0.0]]), np.abs(s["qd"]) / s["speed_scale"], TIME)[1]
    return -(fall * np.ravel(warmth) + per_kelvin * (s["temperature"] - 20.0)) * np.sign(s["qd"])


def bumper(s, above, below, where):
    return np.interp(s["q"], [where - 9, where, where + 9], [-9 * below, 0.0, 9 * above])


def sprung_link(s, stiffness, damping):
    inertia = s["inertia"][0]

    def rate(time, state):
        return [state[1], (load(time) - damping * state[1] - stiffness * state[0]) / inertia]

    start = [load(0.0) / stiffness, 0.0]
    twist, twist_rate = solve_ivp(rate, (0, TIME[-1]), start, "DOP853", TIME, rtol=1e-10, atol=1e-12).y
    return -np.column_stack([twist, twist_rate, rate(TIME, [twist, twist_rate])[1]])


def sprung_beyond(axes):
    """What is beyond a beam on springs about some of its axes, by its modes: each an oscillator of its own."""

    def output(s, stiffness, damping):
        square, modes = np.linalg.eigh(np.linalg.inv(BEYOND[np.ix_(axes, axes)]))
        found = np.zeros((3, TIME.size, len(axes)))
        for lightness, mode in zip(square, modes.T, strict=True):

            def pull(time, mode=mode):
                return transmitted(time)[..., axes] @ mode

            def rate(time, state, lightness=lightness, pull=pull):
                return [state[1], lightness * (pull(time) - damping * state[1] - stiffness * state[0])]

            start = [pull(0.0) / stiffness, 0.0]
            turn, turning = solve_ivp(rate, (0, TIME[-1]), start, "DOP853", TIME, rtol=1e-10, atol=1e-12).y
            for x, own in zip(found, (turn, turning, rate(TIME, [turn, turning])[1]), strict=True):
                x += np.outer(own, mode)
        whole = np.zeros((TIME.size, 9))
        for order, x in enumerate(found):
            whole[:, [3 * order + k for k in axes]] = -x
        return whole

    return output


def free_play(s, stiffness, damping, gap):
    """A gear with a dead band of sharp corners, integrated piece by piece between them."""
    inertia = s["inertia"][0]

    def rate(time, state):
        spring = stiffness * (state[0] - np.clip(state[0], -gap / 2, gap / 2))
        return [state[1], (load(time) - damping * state[1] - spring) / inertia]

    start = [load(0.0) / stiffness + gap / 2 * np.sign(load(0.0)), 0.0]
    found = solve_ivp(rate, (0, TIME[-1]), start, "DOP853", TIME, rtol=1e-8, atol=1e-10, max_step=DT)
    twist, twist_rate = found.y
    return -np.column_stack([twist, twist_rate, [rate(t, x)[1] for t, x in zip(TIME, found.y.T, strict=True)]])


def wrench(*columns):
    return np.stack([np.broadcast_to(column, TIME.shape) for column in columns], axis=1)


def wrong_pull(s, share, lag_loss):
    rise = np.gradient(hang_point(TIME)[0][:, 2], DT, edge_order=2)
    return wrench(0, 0, 475.0 * share - lag_loss * rise, 0, 0, 0)


PLAY = 0.009
"""The most that a latch's play may be [m], nearly."""


def sliding_ball(s, coefficient):
    """Coulomb's cone, by size and angle."""
    size = np.hypot(*s["presliding"].T)
    angle = np.arctan2(s["presliding"][:, 1], s["presliding"][:, 0])
    return (coefficient * s["normal_force"] * size * np.array([np.cos(angle), np.sin(angle)])).T


def loose_latch(s, play):
    """What a spring without play pulls with, less one on the far side of a sphere of free travel."""
    size = np.linalg.norm(s["drawn"], axis=1, keepdims=True)
    beyond = np.clip(size - play / 2, 0, None)
    return 3e3 * s["drawn"] * (1 - beyond / size)


def maxwell(s, share, relaxes):
    """A damper in series with a spring that is held stretched from one second on."""
    run = solve_ivp(lambda _, f: -f / relaxes, (0.0, TIME[-1]), [share * 10.0], "DOP853", rtol=1e-10, dense_output=True)
    lost = np.where(TIME > 1.0, share * 10.0 - run.sol(np.clip(TIME - 1.0, 0, None))[0], 0.0)
    return np.stack([-lost, 0 * lost, 0 * lost], axis=1)


def late_carriage(s, stiffness, lag):
    def follow(time, carriage):
        return (hang_point(time)[0][:2] - carriage) / lag

    position, velocity = hang_point(TIME)[:, :, :2]
    start = position[0] - lag * velocity[0]
    carriage = solve_ivp(follow, (0, TIME[-1]), start, "DOP853", TIME, rtol=1e-10, atol=1e-12).y.T
    x, y = (stiffness * (carriage - position)).T
    return wrench(x, y, 0, 0, 0, 0)


def pin_in_a_hole(s, clearance):
    """The sling's pin stays where it is until the rim of its hole reaches and drags it (a pursuit curve)."""
    path, velocity = hang_point(np.linspace(0, TIME[-1], 20 * (TIME.size - 1) + 1))
    pin = path[0, :2] - clearance * velocity[0, :2] / np.linalg.norm(velocity[0, :2])
    offsets = np.empty((len(path), 2))
    for i, middle in enumerate(path[:, :2]):
        out = pin - middle
        pin = middle + out * min(1.0, clearance / np.linalg.norm(out))
        offsets[i] = pin - middle
    moment = np.cross(np.pad(offsets[::20], ((0, 0), (0, 1))), [0, 0, 400.0])
    return np.hstack([np.zeros_like(moment), moment])


def springs_in_series(s, torque, radius, kind):
    """A boom and the slings beyond it share a misfit angle by their compliances."""
    suspension, spread = 800.0, s["spread"][:, kind]
    boom = radius**2 * suspension
    carried = (torque / boom) / (1 / boom + 1 / (suspension * spread))
    return np.stack([-carried / spread * (kind == k) for k in range(2)], axis=1)


def with_point(s, mass, *place):
    points = np.concatenate([s["points"], s["tip"][:, None] + np.array(place)], axis=1)
    return inertial_parameters(np.pad(s["masses"], ((0, 0), (0, 1)), constant_values=mass), points)


def with_shift(s, *shift):
    return inertial_parameters(s["masses"], s["points"] + np.array(shift))


def extra_bodies(s, *change):
    """The same change on every link, as point masses of either sign: see EXTRA."""
    clouds = (np.broadcast_to(part, (TIME.size, *part.shape)) for part in EXTRA)
    return s["phi"] + inertial_parameters(*clouds)


def at_contact(s, stiffness, damping, friction):
    """Force on the cable by the snare's own compiled law, at overlaps along z and without a cable's give."""
    law = np.array([stiffness, damping, friction, s["slip_velocity"][0], 0.0, 0.0])
    up = (0.0, 0.0, 1.0)
    sink = zip(s["overlap"], s["approach"], s["slip"], strict=True)
    return np.array([contact_law.force(law, -x, 0.0, up, (v[0], v[1], -rate)) for x, rate, v in sink])


def engine_friction(s, coefficient):
    """On the pin, of a contact whose slip lies across z; the normal force is the signals' own, as 2 x^1.5 is."""
    flat = {**s, "approach": 0.0 * s["approach"]}
    across = s["slip"] * [1.0, 1.0, 0.0]
    ours = at_contact(flat, 2.0, 0.0, 0.0) - at_contact(flat, 2.0, 0.0, coefficient)
    small, whole = np.hypot(*across.T[:2]), np.linalg.norm(s["slip"], axis=1)
    # The signals slip along z, too: turn the whole into the plane and back.
    size = np.hypot(ours[:, 0], ours[:, 1]) * np.hypot(small, 2e-4) / small * whole / np.hypot(whole, 2e-4)
    return s["slip"] / whole[:, None] * size[:, None]


def engine_damping(s, coefficient):
    slow = {**s, "approach": 1e-3 * s["approach"]}  # where the whole force stays above zero
    return 1e3 * (at_contact(slow, 2.0, coefficient, 0.0) - at_contact(slow, 2.0, 0.0, 0.0))[:, 2]


def engine_stiffness(s, stiffness):
    return at_contact({**s, "approach": 0.0 * s["approach"]}, stiffness, 0.0, 0.0)[:, 2]


def bending(s):
    """Moment of a rope whose curvature swings: its rate is the signal."""
    return s["bending_stiffness"] * np.cumsum(s["curvature_rate"]) * DT


def three_springs(s, stiffness):
    return np.stack([np.interp(x, [-9, 9], [9 * stiffness, -9 * stiffness]) for x in s["displacement"].T], axis=1)


EXTRA = (np.array([0.8, -0.3, 0.5]), np.array([[0.3, -0.9, 1.1], [0.7, 0.4, -0.6], [-1.0, 0.8, 0.5]]))
TEN = ("mass", *(f"moment_{a}" for a in "xyz"), *(f"inertia_{ab}" for ab in ("xx", "xy", "xz", "yy", "yz", "zz")))
MAKKAR = {"stribeck_level": 2.0, "stribeck_speed": 0.03, "stribeck_ratio": 12.0, "coulomb_level": 4.0}
MAKKAR |= {"coulomb_speed": 1.2, "viscous_coefficient": 0.8}

REFERENCES = {
    "viscous_friction": Reference({"coefficient": 3.0}, lambda s, c: c * np.gradient(s["q"], DT, edge_order=2)),
    "coulomb_friction": Reference({"level": 5.0}, lambda s, level: level * np.sign(s["qd"])),
    "asymmetric_friction": Reference({"level_difference": 1.5, "coefficient_difference": -0.4}, both_directions),
    "stribeck_friction": Reference({"level": 2.0, "speed": 0.3}, gaussian_bump),
    "makkar_friction": Reference(MAKKAR, makkar, tolerance=0.1),
    "quadratic_friction": Reference({"coefficient": 0.7}, lambda s, c: np.where(s["qd"] > 0, c, -c) * s["qd"] ** 2),
    "load_dependent_friction": Reference({"coefficient": 0.12}, lambda s, c: c * np.copysign(s["load"], s["qd"])),
    "position_dependent_friction": Reference({"cosine": 0.6, "sine": -0.8, "period": 1.3}, friction_table),
    "presliding_hysteresis": Reference({"level": 3.0, "travel": 0.08, "by_load": 0.05}, late_friction),
    "gear_efficiency": Reference({"driving_loss": 0.25, "braking_loss": 0.1}, by_quadrant),
    "motor_saturation": Reference({"excess": 0.6, "knee": 1.4, "no_load_speed": 9.0}, saturated, likeness=0.1),
    "heating_friction": Reference({"fall": 3.0, "per_kelvin": 0.2, "time": 5.0}, warmed, tolerance=0.1),
    "end_stop": Reference({"above": 30.0, "below": 4.0, "where": 0.6}, bumper, likeness=0.01),
    "joint_spring": Reference({"stiffness": 6.0, "torque_at_zero": 2.4}, spring),
    "rotor_inertia": Reference({"inertia": 0.4}, lambda s, inertia: np.gradient(inertia * s["qd"], DT, edge_order=2)),
    "torque_ripple": Reference({"cosine": 0.3, "sine": 0.5, "period": 0.21}, ripple),
    "joint_elasticity": Reference({"stiffness": 3000.0, "damping": 15.0}, sprung_link),
    "backlash": Reference({"stiffness": 2000.0, "damping": 50.0, "gap": 0.03}, free_play, likeness=0.1),
    "slide_friction": Reference(MAKKAR, makkar, tolerance=0.1),
    "sling_tension_error": Reference({"share": -0.04, "lag_loss": 120.0}, wrong_pull),
    "suspension_sway": Reference({"stiffness": 150.0, "lag": 0.8}, late_carriage),
    "hang_point_clearance": Reference({"clearance": 0.015}, pin_in_a_hole, likeness=0.05),
    "link_torsion": Reference({"torque": 300.0, "radius": 2.0}, lambda s, t, r: springs_in_series(s, t, r, 0)),
    "link_bending": Reference({"torque": -500.0, "radius": 4.0}, lambda s, t, r: springs_in_series(s, t, r, 1)),
    "link_torsion elsewhere": Reference({"stiffness": 3000.0, "damping": 15.0}, sprung_beyond([0])),
    "link_bending elsewhere": Reference({"stiffness": 4000.0, "damping": 25.0}, sprung_beyond([1, 2])),
    "suspension_stiffness": Reference({"stiffness": 700.0}, lambda s, k: np.repeat(k, TIME.size)),
    "payload_mass": Reference({"mass": 1.7, "x": 0.05, "y": -0.1, "z": 0.15}, with_point),
    "com_offset": Reference({"x": 0.2, "y": -0.1, "z": 0.3}, with_shift),
    "inertia_error": Reference(dict(zip(TEN, inertial_parameters(*EXTRA), strict=True)), extra_bodies),
    "harness_stiffness": Reference({"stiffness": 6.0, "torque_at_zero": 2.4}, spring),
    "external_torque": Reference({"x": 0.4, "y": -0.2, "z": 0.7}, steady_moment),
    "flexible_appendage": Reference(
        {"inertia_x": 4.0, "inertia_y": 9.0, "inertia_z": 2.0, "frequency": 0.6, "damping": 0.03}, bending_panels
    ),
    "propellant_slosh": Reference(
        dict.fromkeys(("mass_x", "mass_y", "mass_z"), 40.0)
        | {"x": 0.3, "y": -0.4, "z": 0.5, "frequency": 0.4, "damping": 0.05},
        mass_in_a_tank,
    ),
    "wheel_friction": Reference(
        {"loss_x": 0.3, "loss_y": 0.1, "loss_z": 0.2, "coulomb_x": 0.1, "coulomb_y": 0.05, "coulomb_z": 0.05}
        | {"inertia": 4.0},
        turning_wheels,
        tolerance=0.05,
        likeness=2e-2,  # the law brings a wheel to rest over 0.1 s
    ),
    "contact_friction": Reference({"coefficient": 0.2}, engine_friction),
    "contact_damping": Reference({"coefficient": 0.3}, engine_damping),
    "contact_stiffness": Reference({"stiffness": 3.0}, engine_stiffness),
    "cable_damping": Reference(
        {"time": 0.02}, lambda s, t: np.gradient(bending(s), DT, edge_order=2) * t, likeness=1e-2
    ),
    "cable_pretension": Reference({"tension": 40.0}, lambda s, tension: np.full(TIME.size, tension)),
    "carriage_friction": Reference(
        {"level": 30.0, "viscous": 4.0}, lambda s, a, b: np.where(s["qd"] > 0, a, -a) + b * s["qd"]
    ),
    "docking_friction": Reference({"coefficient": 0.2}, sliding_ball),
    "groove_misalignment": Reference({"offset": 0.003}, lambda s, x: np.repeat(x, TIME.size)),
    "latch_play": Reference({"play": 0.9 * PLAY}, loose_latch),
    "preload_loss": Reference({"share": 0.3, "time": 2.0}, maxwell),
    "umbilical_stiffness": Reference({"stiffness": 80.0}, three_springs),
    "sensor_bias": Reference({"offset": 0.3}, lambda s, offset: np.polyval([1.0, offset], s["value"])),
    "sensor_drift": Reference({"rate": 0.05}, lambda s, rate: np.interp(TIME, [0, 9], [0, 9 * rate]) + s["value"]),
    "sensor_gain": Reference({"error": -0.07}, lambda s, error: np.polyval([1 + error, 0.0], s["value"])),
    "command_delay": Reference({"delay": 0.017}, lambda s, delay: value(TIME + delay), settle=0.3),
    "sensor_delay": Reference({"delay": 0.013}, lambda s, delay: value(TIME - delay), settle=0.3),
}
