"""One contract for every effect found in models/effects."""

import itertools
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.signal import lsim
from scipy.spatial.transform import Rotation

import snarelab.models.effects
from snarelab.errors import InputError
from snarelab.models.effects import FAMILIES, effects, get_effect
from snarelab.models.hidden_state import THROUGH, Evaluation, evaluate_law

VOCABULARY = """
viscous_friction coulomb_friction asymmetric_friction stribeck_friction makkar_friction quadratic_friction
load_dependent_friction position_dependent_friction presliding_hysteresis joint_elasticity backlash torque_ripple
rotor_inertia link_torsion link_bending payload_mass com_offset inertia_error harness_stiffness slide_friction
sling_tension_error suspension_sway hang_point_clearance external_torque flexible_appendage propellant_slosh
wheel_friction contact_friction contact_damping contact_stiffness cable_damping cable_pretension umbilical_stiffness
sensor_bias sensor_drift sensor_gain sensor_delay
"""
NAMES = list(effects())
DT = 2e-3
TIME = np.arange(4000) * DT


def wave(time, *terms):
    """Sum of amplitude * sin(2 pi frequency time + phase), and its first two derivatives."""
    total = np.zeros((3, *np.shape(time)))
    for amplitude, frequency, phase in terms:
        turn = 2 * np.pi * frequency
        sine, cosine = np.sin(turn * time + phase), np.cos(turn * time + phase)
        total += amplitude * np.stack([sine, turn * cosine, -(turn**2) * sine])
    return total


def load(time):
    return wave(time, (20.0, 0.31, 0.4), (9.0, 1.7, 1.1), (4.0, 3.3, 2.0))[0]


def value(time):
    return wave(time, (2.0, 0.41, 0.3), (1.0, 1.9, 1.7), (0.5, 4.1, 0.2))[0]


def hang_point(time):
    """A sling's hang point on its way, and its velocity: (2, n, 3) [m, m/s]."""
    paths = [wave(time, (0.8, 0.17, 0.4), (0.2, 0.53, 0.1)), wave(time, (0.6, 0.23, 1.3)), wave(time, (0.1, 0.4, 2.0))]
    return np.stack(paths, axis=-1)[:2]


def signals():
    """A joint's motion over 8 s, and 4000 random links; speeds from a crawl to about 4 rad/s."""
    q, qd, qdd = wave(TIME, (0.9, 0.23, 0.1), (0.4, 0.71, 1.3), (0.12, 1.9, 0.7))
    rng = np.random.default_rng(3)
    points = rng.normal(size=(TIME.size, 6, 3))
    masses = rng.uniform(0.5, 2.0, size=(TIME.size, 6))
    columns = {"q": q, "qd": qd, "qdd": qdd, "load": load(TIME), "inertia": 2.0, "temperature": 20.0, "time": TIME}
    columns |= {"speed_scale": np.abs(qd).max(), "value": value(TIME)}
    scalars = {name: np.broadcast_to(column, TIME.shape) for name, column in columns.items()}
    links = {"phi": inertial_parameters(masses, points), "tip": rng.normal(size=(TIME.size, 3))}
    slings = {
        "velocity": hang_point(TIME)[1],
        "weight": np.full(TIME.size, 400.0),
        "tension": np.full(TIME.size, 475.0),
    }
    links |= slings | {"spread": np.stack([4 + 3 * q**2, 20 + qd**2], axis=1)}
    links |= {"spin_rate": shaken(TIME)[0], "acceleration": shaken(TIME)[1]}
    links |= {"spin": spin(TIME), "spin_gained": spin(TIME), "impulse": told(TIME)[0]}
    return scalars | links | {"points": points, "masses": masses}


def shaken(time):
    """A base's angular and linear acceleration (2, n, 3) [rad/s², m/s²] that start from rest."""
    x, y, z = wave(time, (0.2, 0.31, 0.0), (0.1, 1.1, 0.0)), wave(time, (0.3, 0.23, 0.0)), wave(time, (0.1, 0.7, 0.0))
    return np.stack([[x[0], y[0], z[0]], [y[0], z[0], -x[0]]]).transpose(0, 2, 1)


def spin(time):
    """The base's angular velocity (n, 3) [rad/s], none at the start: the integral of `shaken`'s first."""
    x = 0.2 / 0.31 * np.sin(np.pi * 0.31 * time) ** 2 + 0.1 / 1.1 * np.sin(np.pi * 1.1 * time) ** 2
    y, z = 0.3 / 0.23 * np.sin(np.pi * 0.23 * time) ** 2, 0.1 / 0.7 * np.sin(np.pi * 0.7 * time) ** 2
    return np.stack([x, y, z], axis=-1) / np.pi


def told(time):
    """Impulse that wheels were told to give a base, and the torque (2, n, 3) [N·m·s, N·m]."""
    waves = [wave(time, (2.0, 0.31, 0.0)), wave(time, (1.5, 0.4, 0.0)), wave(time, (0.7, 0.9, 0.0))]
    return np.stack(waves, axis=-1)[:2]


def inertial_parameters(masses, points):
    """The ten numbers of clouds of point masses, by summation: shapes (n, k) and (n, k, 3) to (n, 10)."""
    x, y, z = np.moveaxis(points, -1, 0)
    terms = [np.ones_like(x), x, y, z, y**2 + z**2, -x * y, -x * z, x**2 + z**2, -y * z, x**2 + y**2]
    return np.stack([(masses * term).sum(axis=-1) for term in terms], axis=-1)


# ---- References: what hardware would have recorded, written without the laws -----------------------------------------


@dataclass(frozen=True)
class Reference:
    """True parameters by name, and what is measured with them: ``output(signals, *their values)``."""

    truth: dict[str, float]
    output: Callable[..., np.ndarray]
    tolerance: float = 0.02  # on each parameter, relative to its true value
    settle: float = 0.0  # s left out at the start: what was before it is not in the recording
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


def late_friction(s, level, travel):
    """Dahl's curve in closed form, from reversal to reversal: exponential in the distance gone since the last."""
    q, sign = s["q"], np.sign(s["qd"])
    bent, turned, start = np.empty_like(q), 0, sign[0]
    for i in range(q.size):
        if sign[i] != sign[turned]:
            turned, start = i, bent[i - 1]
        bent[i] = sign[i] - (sign[i] - start) * np.exp(-abs(q[i] - q[turned]) / travel)
    return level * (bent - sign)


def friction_table(s, cosine, sine, period):
    grid = np.linspace(0, 1, 2001)
    amplitude, lead = np.hypot(cosine, sine), np.arctan2(sine, cosine) / (2 * np.pi)
    level = np.interp(s["q"] / period % 1, grid, amplitude * np.cos(2 * np.pi * (grid - lead)))
    return level * np.sign(s["qd"])


def spring(s, stiffness, torque_at_zero):
    return np.interp(s["q"], [-9, 9], [torque_at_zero - 9 * stiffness, torque_at_zero + 9 * stiffness])


def ripple(s, cosine, sine, period):
    return np.real((cosine - 1j * sine) * np.exp(2j * np.pi * s["q"] / period))


def sprung_link(s, stiffness, damping):
    inertia = s["inertia"][0]

    def rate(time, state):
        return [state[1], (load(time) - damping * state[1] - stiffness * state[0]) / inertia]

    start = [load(0.0) / stiffness, 0.0]
    twist, twist_rate = solve_ivp(rate, (0, TIME[-1]), start, "DOP853", TIME, rtol=1e-10, atol=1e-12).y
    return -np.column_stack([twist, twist_rate, rate(TIME, [twist, twist_rate])[1]])


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
    "presliding_hysteresis": Reference({"level": 3.0, "travel": 0.08}, late_friction),
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
    "sensor_bias": Reference({"offset": 0.3}, lambda s, offset: np.polyval([1.0, offset], s["value"])),
    "sensor_drift": Reference({"rate": 0.05}, lambda s, rate: np.interp(TIME, [0, 9], [0, 9 * rate]) + s["value"]),
    "sensor_gain": Reference({"error": -0.07}, lambda s, error: np.polyval([1 + error, 0.0], s["value"])),
    "sensor_delay": Reference({"delay": 0.013}, lambda s, delay: value(TIME - delay), settle=0.3),
}


def reference_of(name):
    if name not in REFERENCES:
        pytest.fail(
            f"effect '{name}' has no reference: add REFERENCES['{name}'] to tests/test_effects.py, a "
            "Reference(truth, output) whose output does without the effect's law (closed form, solve_ivp, theorem)"
        )
    return REFERENCES[name]


def scale_of(parameter, s):
    travel, torque = np.ptp(s["q"]), np.abs(s["load"]).max()
    scales = {"": 1.0, "speed": s["speed_scale"][0], "travel": travel, "torque": torque, "rate": torque / travel}
    return scales[parameter.relative_to]


def draw(parameter, s, rng):
    """A random value inside the bounds."""
    if np.isfinite(parameter.high):
        low = max(parameter.low, 1e-3 * parameter.high)
        return scale_of(parameter, s) * np.exp(rng.uniform(*np.log([low, parameter.high])))
    drawn = rng.normal()
    return drawn if drawn > parameter.low else abs(drawn)


def evaluate(effect, s, parameters) -> Evaluation:
    return evaluate_law(effect, s, np.asarray(parameters), dt=DT)


def baseline(effect, s):
    """What stands where the effect acts, without it."""
    return s[THROUGH[effect.at]].reshape(TIME.size, -1) if effect.at in ("link", "sensor") else 0.0


def rms(rows):
    return np.sqrt(np.mean(rows**2, axis=0))


def fit(effect, s, measured, keep):
    """Best start on the shapes' grid with the amplitudes by linear least squares, then a nonlinear refinement."""
    spread = rms(measured - baseline(effect, s)) + 1e-9
    scales = np.array([scale_of(parameter, s) for parameter in effect.parameters])
    low = np.array([parameter.low for parameter in effect.parameters]) * scales
    high = np.array([parameter.high for parameter in effect.parameters]) * scales
    amplitudes = np.array([not parameter.grid for parameter in effect.parameters])

    def residual(p):
        return ((evaluate(effect, s, p).values - measured) / spread)[keep].ravel()

    def slope(p):
        return (evaluate(effect, s, p).by_parameter / spread[:, None])[keep].reshape(-1, p.size)

    starts = []
    for shape in itertools.product(*(parameter.grid or (0.0,) for parameter in effect.parameters)):
        start = np.array(shape) * scales
        if amplitudes.any():
            start[amplitudes] -= np.linalg.lstsq(slope(start)[:, amplitudes], residual(start))[0]
        start = np.clip(start, low, high)
        starts.append((np.sum(residual(start) ** 2), tuple(start)))
    how: dict[str, Any] = {"jac": slope, "bounds": (low, high), "x_scale": "jac", "xtol": 1e-10}
    return least_squares(residual, min(starts)[1], **how).x


@pytest.mark.parametrize("name", NAMES)
def test_metadata_is_complete(name):
    effect = effects()[name]
    assert name in re.split(r"\s+", VOCABULARY)
    assert effect.family in FAMILIES
    assert min(len(effect.sentence), len(effect.equation)) > 10
    assert effect.experiment.format(at="joint3").count("joint3") == effect.experiment.count("{at}") > 0
    assert set(effect.contains) <= set(NAMES) - {name}
    assert re.search(r"\(.*(\d{4}|eq).*\)|\d{4}", effect.source)
    assert bool(effect.states) == bool(effect.rate)
    units = pint.UnitRegistry()
    for parameter in effect.parameters:
        assert parameter.meaning
        for torque, position in (("(N*m)", "rad"), ("N", "m")):
            spelled = {"T": torque, "S": position, "U": "(N*m)"}
            units.parse_units(re.sub(r"\b[TSU]\b", lambda match, by=spelled: by[match[0]], parameter.unit))
        assert all(parameter.low <= number <= parameter.high for number in (*parameter.grid, parameter.zero))
        assert list(parameter.grid) in (sorted(parameter.grid), sorted(parameter.grid, reverse=True))
        assert not parameter.relative_to or parameter.grid


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_agree_with_finite_differences(name):
    effect, s, rng = effects()[name], signals(), np.random.default_rng(11)
    through = THROUGH.get(effect.at, "")
    for _ in range(4):
        p = np.array([draw(parameter, s, rng) for parameter in effect.parameters])
        result = evaluate(effect, s, p)
        for i in range(p.size):
            step = 1e-5 * max(abs(p[i]), 1e-3) * np.eye(p.size)[i]
            change = (evaluate(effect, s, p + step).values - evaluate(effect, s, p - step).values) / (2 * step[i])
            size = np.abs(change).max(axis=0) + 1e-6 * np.abs(result.values).max(axis=0) / max(abs(p[i]), 1e-3)
            assert np.all(np.abs(result.by_parameter[:, :, i] - change) <= 2e-5 * size + 1e-12)
        if result.by_signal is None:
            continue
        for i in range(result.by_signal.shape[2]) if not effect.states else ():
            step = 1e-6 * (np.eye(10)[i] if effect.at == "link" else 1.0)
            ahead, behind = (evaluate(effect, s | {through: s[through] + sign * step}, p) for sign in (1, -1))
            change = (ahead.values - behind.values) / 2e-6
            np.testing.assert_allclose(result.by_signal[:, :, i], change, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_zero_amplitude_equals_baseline(name):
    effect, s, rng = effects()[name], signals(), np.random.default_rng(12)
    elastic = effect.acts_on == "position"  # vanishes as the stiffness grows, not at zero
    p = [draw(parameter, s, rng) if parameter.zero else 0.0 for parameter in effect.parameters]
    if elastic:
        p[0] = 1e14
    result = evaluate(effect, s, p).values
    np.testing.assert_allclose(result, np.broadcast_to(baseline(effect, s), result.shape), rtol=0, atol=1e-6)
    if not elastic:
        p = [draw(parameter, s, rng) for parameter in effect.parameters]
        assert np.abs(evaluate(effect, s, p).values - baseline(effect, s)).max() > 1e-3


@pytest.mark.parametrize("name", [name for name in NAMES if effects()[name].dissipates])
def test_friction_never_feeds_energy_in(name):
    effect, s, rng = effects()[name], signals(), np.random.default_rng(13)
    s = s | {"qd": np.sign(s["qd"]) * 10 ** rng.uniform(-7, 1.5, TIME.size), "load": rng.normal(size=TIME.size)}
    for _ in range(50):
        p = np.array([draw(parameter, s, rng) for parameter in effect.parameters])
        power = s["qd"] * evaluate(effect, s, p).values[:, 0]
        assert power.min() >= -1e-12 * power.max()
        assert power.max() > 0


@pytest.mark.parametrize("name", NAMES)
def test_recovers_parameters_from_data_it_did_not_generate(name):
    effect, s, rng = effects()[name], signals(), np.random.default_rng(14)
    reference = reference_of(name)
    truth = [reference.truth[parameter.name] for parameter in effect.parameters]
    clean = reference.output(s, *reference.truth.values()).reshape(TIME.size, -1)
    keep = s["time"] >= reference.settle
    size = rms(clean - baseline(effect, s))
    sharp = keep & (np.abs(s["qd"]) > 0.005 * s["speed_scale"])  # where a smooth sign equals a sign
    assert np.all(rms((evaluate(effect, s, truth).values - clean)[sharp]) <= reference.likeness * size)
    measured = clean + 0.01 * size * rng.normal(size=clean.shape)
    np.testing.assert_allclose(fit(effect, s, measured, keep), truth, rtol=reference.tolerance)


def test_effect_without_reference_says_what_to_add():
    with pytest.raises(pytest.fail.Exception, match=r"add REFERENCES\['new_effect'\] to tests/test_effects.py"):
        reference_of("new_effect")


def test_members_are_the_files_in_order_of_family():
    folder = Path(snarelab.models.effects.__path__[0])
    assert sorted(NAMES) == sorted(path.stem for path in folder.glob("[!_]*.py"))
    families = [FAMILIES.index(effects()[name].family) for name in NAMES]
    assert families == sorted(families)


def test_unknown_effect_names_the_nearest_and_all():
    assert get_effect("torque_ripple").name == "torque_ripple"
    with pytest.raises(InputError) as caught:
        get_effect("columb_friction")
    message = str(caught.value)
    assert "'columb_friction'" in message
    assert "nearest: coulomb_friction" in message
    assert all(name in message for name in NAMES)
    assert "\n" not in message
