"""A robot with its drives: what is simulated, and what its sensors make of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .bodies import Bodies, inertias_along, torques
from .laws import TABLE, Friction, Laws, directions
from .loop import TICK, Drives, run
from .motions import STILL
from .robots import Rng, Robot

RIGID = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Law:
    """A law of `laws.torque` at joint ``at``; ``other``: the joint it looks at besides."""

    number: int
    at: int
    size: float
    numbers: tuple[float, ...] = ()
    table: NDArray | None = None
    other: int = 0


@dataclass(frozen=True, eq=False)
class Sensors:
    """What is wrong with torque channels by joint: bias [N·m], gain error, drift (final [N·m], time constant [s]),
    delay [s]; and delays [s] of logged positions.
    """

    bias: Mapping[int, float] = field(default_factory=dict)
    gain: Mapping[int, float] = field(default_factory=dict)
    drift: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    torque_delay: Mapping[int, float] = field(default_factory=dict)
    position_delay: Mapping[int, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Plant:
    """``robot`` is real, ``nominal`` what its servo believes in. Arrays (n,) by joint; ``rotor`` [kg·m²].

    ``springs``: stiffness [N·m/rad], damping [N·m·s/rad] and gap [rad] by joint. ``bandwidth`` [Hz] of the servo;
    ``ahead``: share of the nominal torque that is fed forward, of gravity alone where negative. ``limit`` [N·m].
    """

    robot: Robot
    nominal: Robot
    friction: Friction
    rotor: NDArray
    bandwidth: float
    ahead: float
    limit: NDArray
    lag: float
    count: float
    laws: tuple[Law, ...] = ()
    springs: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    sensors: Sensors = field(default_factory=Sensors)

    def drives(self, asked: NDArray) -> Drives:
        """Gains from the nominal inertia along the asked motion (n_ticks, n)."""
        n = len(self.robot.links)
        inertia = inertias_along(Bodies.of(self.nominal.model()), np.ascontiguousarray(asked[::100]))
        mean = np.diagonal(inertia, axis1=1, axis2=2).mean(axis=0) + self.rotor
        omega = 2.0 * np.pi * self.bandwidth
        motor = np.arange(n)
        for extra, k in enumerate(sorted(self.springs)):
            motor[k] = n + extra
        stiffness, damping, gap = np.array([self.springs.get(k, RIGID) for k in range(n)]).T.copy()
        share = 1.0 - float(np.exp(-2.0 * np.pi * 60.0 * TICK))
        full = np.ones(n)
        return Drives(
            motor,
            self.rotor,
            stiffness,
            damping,
            gap,
            self.lag * full,
            self.limit,
            omega**2 * mean,
            1.6 * omega * mean,
            self.count * full,
            share * full,
        )

    def table(self) -> Laws:
        """The laws as arrays."""
        count = len(self.laws)
        numbers, tables = np.zeros((count, 6)), np.zeros((count, TABLE))
        for k, law in enumerate(self.laws):
            numbers[k, : len(law.numbers)] = law.numbers
            if law.table is not None:
                tables[k] = law.table

        def integers(name: str) -> NDArray:
            return np.array([getattr(law, name) for law in self.laws], dtype=np.int64)

        sizes = np.array([law.size for law in self.laws], dtype=float)
        return Laws(integers("number"), integers("at"), integers("other"), sizes, numbers, tables)

    def simulate(self, motion: tuple[NDArray, NDArray, NDArray], pushes: NDArray) -> NDArray:
        """What is true at every tick (n_ticks, 7, n), as `loop.run` says."""
        q, qd, qdd = motion
        nominal = Bodies.of(self.nominal.model())
        if self.ahead < 0.0:
            fed = -self.ahead * torques(nominal, q, 0.0 * q, 0.0 * q)
        else:
            # At least gravity: no drive starts to move by falling.
            still = torques(nominal, q, 0.0 * q, 0.0 * q)
            fed = still + self.ahead * (torques(nominal, q, qd, qdd) + self.rotor * qdd - still)
        asked = np.stack([q, qd], axis=1)
        bodies = Bodies.of(self.robot.model())
        return run(bodies, self.drives(q), self.friction, self.table(), asked, fed, pushes, -STILL, False)


class Logger(NamedTuple):
    """``rate`` [Hz]; ``step`` [rad] of the logged encoder, ``rough``: noise that it has before it counts [steps];
    ``jitter`` of the time stamps [sampling periods]."""

    rate: float
    step: float
    rough: float = 0.0
    jitter: float = 0.0


def recorded(true: NDArray, sensors: Sensors, logger: Logger, noise: NDArray, rng: Rng) -> dict[str, NDArray]:
    """Readings from a recording's start on: ``time`` [s], ``q.<joint>`` [rad] and ``tau.<joint>`` [N·m], (n_samples,).

    ``noise`` (n,) [N·m], white, of the torque channels.
    """
    first, stride, step = round(STILL / TICK), round(1.0 / (logger.rate * TICK)), logger.step
    all_ticks = TICK * (np.arange(len(true)) - first)
    time = np.round(all_ticks[first::stride], 9)
    found = {"time": time}
    n = true.shape[2]
    hiss = rng.standard_normal((len(time), n)) * noise
    rough = logger.rough * rng.standard_normal((len(time), n))
    stamps = time + logger.jitter / logger.rate * rng.standard_normal(len(time))
    found["time"] = stamps - stamps[0]

    def read(column: int, k: int, late: float) -> NDArray:
        return np.interp(time - late, all_ticks, true[:, column, k])

    for k in range(n):
        q = read(0, k, sensors.position_delay.get(k, 0.0))
        found[f"q.joint{k + 1}"] = step * np.round(q / step + rough[:, k])
    for k in range(n):
        tau = read(3, k, sensors.torque_delay.get(k, 0.0)) * (1.0 + sensors.gain.get(k, 0.0))
        final, slow = sensors.drift.get(k, (0.0, 1.0))
        tau += sensors.bias.get(k, 0.0) + final * (1.0 - np.exp(-time / slow))
        found[f"tau.joint{k + 1}"] = tau + hiss[:, k]
    return found


@dataclass(frozen=True, eq=False)
class Planned:
    """A plant along its asked motion at 250 Hz, as if it followed exactly; arrays (n_samples, n).

    ``load``: torque of the bodies; ``direction`` of friction; ``torque``: all that the motors give.
    """

    plant: Plant
    period: float
    q: NDArray
    qd: NDArray
    qdd: NDArray
    load: NDArray
    direction: NDArray
    torque: NDArray

    @staticmethod
    def of(plant: Plant, motion: tuple[NDArray, NDArray, NDArray]) -> "Planned":
        """Along a motion at the servo's ticks."""
        stride = 4
        return Planned.along(plant, stride * TICK, *(np.ascontiguousarray(x[::stride]) for x in motion))

    @staticmethod
    def along(plant: Plant, period: float, q: NDArray, qd: NDArray, qdd: NDArray) -> "Planned":
        """Along samples (n_samples, n) of this period [s]."""
        load = torques(Bodies.of(plant.robot.model()), q, qd, qdd)
        f = plant.friction
        columns = [
            directions(f.kind[k], f.travel[k], f.lag[k], period, q[:, k].copy(), qd[:, k].copy())
            for k in range(q.shape[1])
        ]
        direction = np.stack(columns, axis=1)
        torque = load + plant.rotor * qdd + f.level * direction + f.viscous * qd
        return Planned(plant, period, q, qd, qdd, load, direction, torque)

    def loads(self, robot: Robot) -> NDArray:
        """Torque of another robot's bodies (n_samples, n)."""
        return torques(Bodies.of(robot.model()), self.q, self.qd, self.qdd)

    def left(self, change: NDArray, known_rotor: bool = True) -> NDArray:
        """What a change (n_samples, n) [N·m] leaves beside refitted friction and rotor inertia of each joint."""
        found = np.empty_like(change)
        for k in range(change.shape[1]):
            columns = [np.sign(self.qd[:, k]), self.qd[:, k], *([self.qdd[:, k]] if known_rotor else [])]
            found[:, k] = remainder(change[:, k], columns)
        return found


def remainder(torque: NDArray, columns: list[NDArray]) -> NDArray:
    """What a least-squares fit of columns leaves of a torque (n_samples,)."""
    matrix = np.stack(columns, axis=1)
    return torque - matrix @ np.linalg.lstsq(matrix, torque, rcond=None)[0]


def rms(x: NDArray) -> NDArray:
    """Root mean square over samples."""
    return np.sqrt(np.mean(np.square(x), axis=0))
