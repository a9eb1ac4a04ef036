"""A docking test as one stiff ODE: the end effector in its mount, drawn into standing grooves, latched, pushed off.

Everything is in the target's frame. The carriage's travel s(t) and the latches' closing are given, as recorded; what
the motor must do follows from the carriage's own balance,

    F = (m + J (2π/l)²) s̈ + friction + x·(cable + bumpers),

x being the end effector's axis, cable and bumpers their forces on the carriage. The cables are a line from the rings'
middle to the knob that bears when longer than its slack. The mount is a linear spring and damper about the pose at the
start. Integrals of all that is seen are states, so that means over any window are exact. Effects of the places of
`bench_setup` enter by their own laws.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..compiled import SampleFunction
from ..dormand_prince import DormandPrince
from ..effects import effects
from ..inertia import Array
from ..rotation import quaternion_rate, rotation_of
from .bench_setup import GROOVES, BenchSetup, docking_effects
from .groove import BALLS, axes
from .mechanism import BRISTLES, Laws, bumped, constants, docked
from .parameters import DockingParameters

SEEN = (
    *(f"pos.effector.{a}" for a in "xyz"),
    *(f"turn.effector.{a}" for a in "xyz"),
    *(f"force.target.{a}" for a in "xyz"),
    *(f"torque.target.{a}" for a in "xyz"),
    "tau.carriage",
    *(f"tension.latch{i + 1}" for i in range(BALLS)),
)
"""What is seen: place [m], rotation vector since the start [rad], wrench on the target about its frame [N, N·m], the
motor's force on the carriage [N], and the pull of each latch along the target's axis [N]."""
_RIGID = 13
_STATES = _RIGID + BRISTLES + len(SEEN)
_GIVEN = ("t0", "s", "rate", "square", "cube", "begun", "closed")
"""Of a stretch: its start [s]; travel there [m], its rate [m/s], and the cubic's other two coefficients [m/s², m/s³];
when the latches began to close, and when they were closed [s]."""
NEVER = 1e9
_ABSENT = DockingParameters(friction=0.0, coulomb=0.0, viscous=0.0)
_AXES = [axes(i) for i in range(BALLS)]


@dataclass(frozen=True)
class DockingCommand:
    """What a docking test was told to do.

    Parameters
    ----------
    times : array (n + 1,)
        Ends of the windows over which everything is averaged, from 0 [s].
    travel, rate : array (n + 1,)
        Of the carriage there [m, m/s].
    place, quaternion : array (3,), (4,)
        The end effector's pose at the start, w first, at rest in its mount [m].
    latch : tuple of two floats
        When the latches began to close, and when they were closed [s]; `NEVER` where they were not.
    """

    times: Array
    travel: Array
    rate: Array
    place: Array
    quaternion: Array
    latch: tuple[float, float] = (NEVER, NEVER + 1.0)


def numbers_of(setup: BenchSetup) -> dict[str, float]:
    """Every number that the equations read, by its name; D of the contacts' law [s/m], and the bumpers' own, beside."""
    found = constants(setup.mechanism) | setup.values()
    return found | {"bumper_damping": found["damping"]}


def _hermite(motion: DockingCommand) -> tuple[Array, Array]:
    """Square and cube of each stretch's cubic (n,): it meets travel and rate at both ends."""
    h, gone = np.diff(motion.times), np.diff(motion.travel)
    first, last = motion.rate[:-1], motion.rate[1:]
    return (3 * gone / h - 2 * first - last) / h, (first + last - 2 * gone / h) / h**2


class DockingBench:
    """The equations, compiled once for every set-up and every effect.

    Parameters
    ----------
    tolerance : float
        Relative error of one step, see `DormandPrince`.
    """

    def __init__(self, tolerance: float = 1e-5) -> None:
        """Write and compile the equations."""
        self._effects = {
            f"{name}.{at}.{p.name}": p.zero
            for name, places in docking_effects().items()
            for at in places
            for p in effects()[name].parameters
        }
        setup = BenchSetup(_ABSENT)
        self._names = list(numbers_of(setup))
        t, x = ca.SX.sym("t"), ca.SX.sym("x", _STATES)
        fixed = len(_GIVEN) + 3 * BALLS + 7
        self._fixed = fixed
        u = ca.SX.sym("u", fixed + len(self._names) + len(self._effects))
        rate, balls = self._equations(t, x, u)
        floor = np.concatenate(
            [np.full(3, 1e-3), np.ones(4), np.full(6, 1e-2), np.full(BRISTLES, 1e-5), np.full(len(SEEN), 1e3)]
        )
        self._steps = DormandPrince(ca.Function("rate", [t, x, u], [ca.cse(rate)]), floor, tolerance)
        self._balls = SampleFunction(ca.Function("balls", [x, u], [ca.densify(balls)]))

    def run(self, setup: BenchSetup, values: Mapping[str, float], motion: DockingCommand) -> Array:
        """Means (n, 16) of `SEEN` over each window; raises StepFault where no step is short enough.

        ``values``: parameters of effects by ``effect.place.parameter``, and set-up numbers by their name; what is not
        among them is absent, or the set-up's own.
        """
        numbers = numbers_of(setup) | {k: v for k, v in values.items() if k in self._names}
        own = [values.get(key, zero) for key, zero in self._effects.items()]
        tail = np.concatenate([motion.place, motion.quaternion, [numbers[k] for k in self._names], own])
        state = np.concatenate([motion.place, motion.quaternion, np.zeros(_STATES - 7)])
        held, size, seen = np.zeros(3 * BALLS), 1e-4, np.zeros((len(motion.times), len(SEEN)))
        begun, closed = motion.latch
        square, cube = _hermite(motion)
        for k, (a, b) in enumerate(zip(motion.times[:-1], motion.times[1:], strict=True)):
            moved = [a, motion.travel[k], motion.rate[k], square[k], cube[k], begun, closed]
            u = np.concatenate([moved, held, tail])
            if a <= begun < b:
                if begun > a:
                    state, size = self._go(a, state, begun, u, size)
                u[len(_GIVEN) : len(_GIVEN) + 3 * BALLS] = held = self._balls(state[None], u)[0][0, :, 0]
            state, size = self._go(begun if a <= begun < b else a, state, b, u, size)
            seen[k + 1] = state[-len(SEEN) :]
        return np.diff(seen, axis=0) / np.diff(motion.times)[:, None]

    def _go(self, time: float, state: Array, end: float, u: Array, size: float) -> tuple[Array, float]:
        steps = self._steps.advance(time, state, end, u, min(size, end - time))
        return steps.state, steps.size

    def _equations(self, t: ca.SX, x: ca.SX, u: ca.SX) -> tuple[ca.SX, ca.SX]:
        given = dict(zip(_GIVEN, ca.vertsplit(u[: len(_GIVEN)]), strict=True))
        first = len(_GIVEN)
        held, rest, facing = u[first : first + 9], u[first + 9 : first + 12], u[first + 12 : first + 16]
        n = len(self._names)
        p = dict(zip(self._names, ca.vertsplit(u[self._fixed : self._fixed + n]), strict=True))
        own = dict(zip(self._effects, ca.vertsplit(u[self._fixed + n :]), strict=True))
        place, quaternion, velocity, spin = x[:3], x[3:7], x[7:10], x[10:13]
        h, c, d = t - given["t0"], given["square"], given["cube"]
        s = given["s"] + h * (given["rate"] + h * (c + h * d))
        rate, acceleration = given["rate"] + h * (2 * c + 3 * h * d), 2 * c + 6 * h * d
        turn, turning = rotation_of(quaternion), rotation_of(quaternion) @ spin
        axis = turn[:, 0]
        share = ca.fmin(ca.fmax((t - given["begun"]) / (given["closed"] - given["begun"]), 0.0), 1.0)

        def all_of(at: str, signals: dict[str, ca.SX], places: tuple[str, ...], size: int) -> ca.SX:
            """What every effect of a place adds."""
            total = ca.SX(size, 1)
            for name, where in docking_effects().items():
                for place_ in where:
                    if effects()[name].at == at and place_ in places:
                        names = {q.name: own[f"{name}.{place_}.{q.name}"] for q in effects()[name].parameters}
                        total += effects()[name].law(signals, names)
            return total

        laws = Laws(
            lambda normal, bent: all_of("grooves", {"normal_force": normal, "presliding": bent}, ("grooves",), 2),
            lambda ball: all_of("groove", {"across": ca.SX(0)}, (GROOVES[ball],), 1),
            lambda drawn: all_of(
                "latches",
                {"drawn": drawn, "stiffness": p["latch_stiffness"], "preload": p["latch_preload"],
                 "since": t - given["begun"]},
                ("latches",), 3,
            ),
        )  # fmt: skip
        found = docked(
            place, turn, velocity, turning, x[_RIGID : _RIGID + BRISTLES], ca.repmat(share, BALLS, 1), held, p, laws
        )
        bump, bump_moment, _, _ = bumped(place, turn, velocity, turning, s, rate, p | {"damping": p["bumper_damping"]})
        rings = place - (p["ring"] + s) * axis
        rings_speed = velocity - rate * axis - ca.cross(turning, (p["ring"] + s) * axis)
        line = ca.vertcat(-p["knob"], 0, 0) - rings
        length = ca.sqrt(ca.dot(line, line) + 1e-12)
        way = line / length
        stretch = length - p["slack"]
        # The knob passes the rings' plane: only what lies towards the target draws.
        taut = ca.logic_and(stretch > 0, ca.dot(way, axis) > 0)
        tension = ca.if_else(
            taut, ca.fmax(p["cable_stiffness"] * stretch - p["cable_damping"] * ca.dot(way, rings_speed), 0.0), 0.0
        )
        cable = tension * way
        load = ca.dot(axis, cable + bump)
        friction = all_of(
            "carriage", {"qd": rate, "load": load, "slip_velocity": p["coulomb_speed"], "time": t}, ("carriage",), 1
        )
        moved = p["carriage_mass"] + p["rotor"] * (2 * np.pi / p["lead"]) ** 2
        motor = moved * acceleration + friction + load

        unit, start = quaternion / ca.norm_2(quaternion), facing / ca.norm_2(facing)
        # Rotation since the start, in the target's axes: q q0*.
        w = ca.dot(unit, start)
        vector = -unit[0] * start[1:] + start[0] * unit[1:] - ca.cross(unit[1:], start[1:])
        size = ca.sqrt(ca.dot(vector, vector) + 1e-30)
        turned = 2 * ca.atan2(size, w) / size * vector
        on_mount = -p["mount_stiffness"] * (place - rest) - p["mount_damping"] * velocity
        on_mount_moment = -p["turning_stiffness"] * turned - p["turning_damping"] * turning
        # Origin and mass are those of all together; the carriage's own acceleration pushes back.
        force = found.force + cable + bump + on_mount + p["carriage_mass"] * acceleration * axis
        moment = found.moment + ca.cross(rings - place, cable) + on_mount_moment
        moment += bump_moment - ca.cross(s * axis, bump)
        inertia = ca.vertcat(p["inertia_x"], p["inertia_y"], p["inertia_z"])
        on_target = -(found.force + cable + bump)
        about = -(found.moment + ca.cross(place, found.force) + ca.cross(rings, cable))
        about -= bump_moment + ca.cross(place - s * axis, bump)
        rates = ca.vertcat(
            velocity,
            quaternion_rate(quaternion, spin),
            force / p["mass"],
            (turn.T @ moment - ca.cross(spin, inertia * spin)) / inertia,
            found.bristle_rate,
            place, turned, on_target, about, motor, found.grip,
        )  # fmt: skip
        balls = [place + turn @ (p["seat"] * ca.DM(_AXES[i][0]) + p["radius"] * ca.DM(_AXES[i][2])) for i in range(3)]
        return ca.densify(rates), ca.vertcat(*balls)
