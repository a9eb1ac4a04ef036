"""Runs a capture in orbit as one Exudyn system, and keeps what a co-simulation of it shows."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..floating.arm import FloatingArm
from ..floating.dynamics import inertia, tip_pose
from ..inertia import Array
from ..snare.drive import Pose
from ..snare.forces import measure
from ..snare.model import COLD_START, SnareStepError
from ..snare.momentum import momentum
from ..snare.parameters import SnareParameters
from ..snare.settled import settled
from ..snare.solver import SnareSolver
from ..snare.target import Target
from .assembly import MonolithicAssembly


@dataclass(frozen=True)
class MonolithicHistory:
    """A run, in the world frame.

    Parameters
    ----------
    times : array (n,)
        [s]
    tip, pin, base : array (n, 6, 3)
        Frames: position, velocity, angular velocity, rotation [m, m/s, rad/s].
    q, qd : array (n, J)
        Joints [rad, rad/s].
    effector_wrench, pin_wrench : array (n, 6)
        On the end effector about its origin, on the pin about its foot [N, N·m].
    impulse : array (n, 3)
        Of the snare on the end effector since the start [N·s].
    momentum : array (n, 6)
        Of base, arm, cables and target [N·s], and about the tip's place at the start [N·m·s].
    first_contact : float or None
        [s]
    """

    times: Array
    tip: Array
    pin: Array
    base: Array
    q: Array
    qd: Array
    effector_wrench: Array
    pin_wrench: Array
    impulse: Array
    momentum: Array
    first_contact: float | None


class MonolithicCapture:
    """The arm in a pose, its joints passive, with the snare at its tip.

    Parameters
    ----------
    arm : FloatingArm
        Its tip is the end effector; base at the world's origin, at rest.
    q : array (J,)
        Joint positions at the start [rad].
    parameters : SnareParameters
    target : Target
        ``free``, or ``moved``: fixed to the base at the arm's mount.
    friction : mapping of str to float
        Makkar's parameters, the same for each joint.
    rotor : float
        [kg·m²]
    n_elements : int
        Per cable.
    """

    def __init__(
        self,
        arm: FloatingArm,
        q: ArrayLike,
        parameters: SnareParameters,
        target: Target,
        friction: Mapping[str, float],
        rotor: float,
        n_elements: int = 10,
    ) -> None:
        """Build."""
        joints = np.asarray(q, float)
        pose = tip_pose(arm, joints[None])
        self.origin, rotation = pose.translation[0], pose.rotation[0]
        effector = Pose(np.zeros(3), rotation, np.zeros(3), np.zeros(3))
        near = replace(target, position=tuple(np.asarray(target.position) - self.origin))
        nodes = settled(parameters, n_elements) @ rotation.T
        start = np.concatenate([-self.origin, np.zeros(3), joints])
        self.assembly = MonolithicAssembly(parameters, near, nodes, effector, arm, start, friction, rotor)
        a = self.assembly
        self._data = a.system.systemData
        self._ends = self._data.GetObjectLTGAE(a.ends_object)
        self._section = np.array(parameters.section)
        self._wrench, self._impulse, self._time = np.zeros(12), np.zeros(3), 0.0
        self.first_contact: float | None = None
        self._solver = SnareSolver(a.system, 0.0, self._after_step)
        self._read(0.0)
        self._rows: list[tuple[Array, ...]] = []

    def run(
        self, duration: float, every: float = 0.01, step: float = 1e-3, cold_step: float = 5e-4
    ) -> MonolithicHistory:
        """Advance by a duration in steps of ``step`` at most, recorded at regular times [s].

        Raises SnareStepError where the solver does not converge.
        """
        self._rows = []
        self._record()
        for _ in range(round(duration / every)):
            cold = self._solver.time < COLD_START - 1e-9
            if not self._solver.advance(every, cold_step if cold else step):
                raise SnareStepError(
                    f"capture: the solver did not converge at {self._solver.time:g} s; shorten the step"
                )
            self._record()
        times, tip, pin, base, q, qd, wrench, impulse, total = (np.array(x) for x in zip(*self._rows, strict=True))
        return MonolithicHistory(
            times, tip, pin, base, q, qd, wrench[:, 6:], wrench[:, :6], impulse, total, self.first_contact
        )

    def _after_step(self, time: float) -> None:
        since, before = time - self._time, self._wrench
        if since <= 0:
            return
        self._read(time)
        self._impulse = self._impulse + 0.5 * since * (before[6:9] + self._wrench[6:9])
        self._time = time

    def _read(self, time: float) -> None:
        a, data = self.assembly, self._data
        a.place(time)
        pull = data.GetAECoordinates()[self._ends].reshape(6, 3)
        self._wrench, _, contacts, _ = measure(
            a.others(data.GetODE2Coordinates()), a.others(data.GetODE2Coordinates_t()), a.fixed, a.moving,
            self._section, pull, a.ends, a.frame, a.ring_spin(),
        )  # fmt: skip
        if len(contacts) and self.first_contact is None:
            self.first_contact = time

    def _record(self) -> None:
        a = self.assembly
        coordinates, rates = a.tree_state()
        tip, _, base = (frame for frame, _ in a.frames(coordinates, rates))
        world = np.zeros((6, 3))
        world[0] = self.origin
        total = self._tree_momentum(base, coordinates[6:], rates[6:]) + momentum(a)
        self._rows.append(
            (
                np.array(self._solver.time), tip + world, a.pin + world, base + world, coordinates[6:], rates[6:],
                self._wrench, self._impulse, total,
            )
        )  # fmt: skip

    def _tree_momentum(self, base: Array, q: Array, qd: Array) -> Array:
        """Of base and arm about the assembly's origin."""
        rotation = base[3:]
        twist = np.concatenate([rotation.T @ base[1], rotation.T @ base[2], qd])
        own = inertia(self.assembly.arm, q[None])[0][:6] @ twist
        linear = rotation @ own[:3]
        return np.concatenate([linear, rotation @ own[3:] + np.cross(base[0], linear)])
