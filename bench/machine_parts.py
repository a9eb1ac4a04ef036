"""What acts in a run of the plant by the laws of ``machine_laws``: parts that a `Plant` is given as its mechanisms."""

# pyright: reportAttributeAccessIssue=false
# (pyright does not see the names that mujoco takes from its compiled module)
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.typing import NDArray

from .machine_laws import Grease, gear_loss
from .mujoco_plant import CONTROL_RATE, Running


@dataclass(frozen=True, eq=False)
class Push:
    """A torque on every joint that nothing measures: a ``table`` (n_instants, n_joints) [T] at the servo's instants."""

    table: NDArray
    start: float = 0.0

    def __call__(self, run: Running) -> Callable[[], None]:
        """Held between the instants; ``start`` [s] is the first one's time. ValueError where MuJoCo starts again."""
        dofs, seen = list(run.dof.values()), [-1.0]

        def act() -> None:
            # A simulation that has become unstable is reset by MuJoCo, and goes on as if nothing had been.
            if run.data.time <= seen[0]:
                raise ValueError(f"the simulation became unstable at {seen[0]:g} s")
            seen[0] = run.data.time
            k = min(int((run.data.time - self.start) * CONTROL_RATE + 1e-6), len(self.table) - 1)
            run.data.qfrc_applied[dofs] += self.table[k]

        return act


@dataclass(frozen=True)
class Gear:
    """`gear_loss` at a joint, of the load that was handed to its link a MuJoCo step ago."""

    joint: str
    driving: float
    braking: float
    scale: float

    def __call__(self, run: Running) -> Callable[[], None]:
        """The load is what the links' motion needs: mass matrix times the acceleration just made, and the rest."""
        data, dof = run.data, run.dof[self.joint]
        before, moved = data.qvel.copy(), np.zeros(run.model.nv)

        def act() -> None:
            mujoco.mj_mulM(run.model, data, moved, (data.qvel - before) / run.model.opt.timestep)
            load, before[:] = moved[dof] + data.qfrc_bias[dof], data.qvel
            data.qfrc_applied[dof] -= gear_loss(load, data.qvel[dof], self.driving, self.braking, self.scale)

        return act


@dataclass(frozen=True)
class Heating:
    """LuGre friction of a joint that falls as its own power warms the grease.

    ``theta`` holds the temperature above the surroundings [K] after each MuJoCo step of the last run.
    """

    joint: str
    grease: Grease
    theta: list[float] = field(default_factory=list)

    def __call__(self, run: Running) -> Callable[[], None]:
        """Starts at the surroundings' temperature."""
        data, dof, step = run.data, run.dof[self.joint], run.model.opt.timestep
        self.theta[:] = [0.0]

        def act() -> None:
            theta, cold = self.theta[-1], run.bristles.resistance(self.joint)
            lost = float(self.grease.lost(theta))
            data.qfrc_applied[dof] += lost * cold
            # Bristles give a little back near rest: that is no heat.
            power = max((1.0 - lost) * cold * float(data.qvel[dof]), 0.0)
            self.theta.append(self.grease.warmed(theta, power, step))

        return act


@dataclass(frozen=True, eq=False)
class Law:
    """A torque on a joint by its own position and speed [T]."""

    joint: str
    torque: Callable[[float, float], float]

    def __call__(self, run: Running) -> Callable[[], None]:
        """Added to what acts on the joint."""
        data, dof = run.data, run.dof[self.joint]

        def act() -> None:
            data.qfrc_applied[dof] += self.torque(float(data.qpos[dof]), float(data.qvel[dof]))

        return act


@dataclass(frozen=True)
class Queue:
    """A motor that gives what was asked of it ``steps`` MuJoCo steps ago."""

    steps: int

    def __call__(self) -> Callable[[float], float]:
        """A queue that is full of the first torque asked for."""
        waiting: deque[float] = deque()

        def give(asked: float) -> float:
            waiting.extend([asked] * (1 if waiting else self.steps + 1))
            return waiting.popleft()

        return give


@dataclass(frozen=True, eq=False)
class Iron:
    """A motor without memory: ``law`` from the torque asked for to the torque given."""

    law: Callable[[float], float]

    def __call__(self) -> Callable[[float], float]:
        """The law itself at all times."""
        return self.law
