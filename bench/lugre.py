"""LuGre friction on MuJoCo joints, with its bristles integrated inside the loop."""

# pyright: reportAttributeAccessIssue=false
# (pyright does not see the names that mujoco takes from its compiled module)
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

MICRO_DAMPING = 1e-3  # s, sigma1 / sigma0


@dataclass(frozen=True)
class LuGre:
    """Friction as bristles that bend and slip (Canudas de Wit, Olsson, Åström, Lischinsky 1995).

    dz/dt = qd − σ0 |qd| z / g(qd),  torque = σ0 z + σ1 dz/dt + viscous·qd,
    g(qd) = level + (static − level) exp(−(qd / stribeck_speed)²) + load_factor·|load|,
    with σ0 = static / deflection and σ1 = σ0 · 1 ms. At constant speed the torque is g(qd)·sign(qd) + viscous·qd.
    ``load`` is the torque handed to the link. The ``*_negative`` values hold for qd < 0 (None: as for qd > 0).
    ``level`` and ``static`` swing by ±``variation`` (a share) with sin(2π q / period).

    Units: T is N·m or N, S is rad or m: level, static [T]; stribeck_speed [S/s]; viscous [T·s/S]; deflection,
    period [S].
    """

    level: float
    static: float | None = None
    stribeck_speed: float = 0.05
    viscous: float = 0.0
    level_negative: float | None = None
    static_negative: float | None = None
    viscous_negative: float | None = None
    load_factor: float = 0.0
    variation: float = 0.0
    period: float = 2.0 * np.pi
    deflection: float = 5e-4

    def __post_init__(self) -> None:
        """Refuse a level that bristles cannot have."""
        if min(x for x in (self.level, self.static, self.level_negative, self.static_negative) if x is not None) <= 0.0:
            raise ValueError(f"LuGre: levels must be positive, not {self}; leave the joint out for none")

    def forth(self) -> tuple[float, float, float]:
        """Level, static level and viscous coefficient for qd >= 0."""
        return self.level, self.level if self.static is None else self.static, self.viscous

    def back(self) -> tuple[float, float, float]:
        """The same for qd < 0; where only ``level_negative`` is given, the static level keeps its ratio to it."""
        level, static, viscous = self.forth()
        low = level if self.level_negative is None else self.level_negative
        high = static * low / level if self.static_negative is None else self.static_negative
        return low, high, viscous if self.viscous_negative is None else self.viscous_negative


class Bristles:
    """The LuGre joints of one run: ``act`` before each MuJoCo step, ``slip`` after it.

    The torque is made implicit in the speed by handing MuJoCo its derivative as this step's damping (``implicitfast``
    must be the integrator): the bristles are stiff enough to blow up an explicit step on a light link.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, laws: Mapping[str, LuGre]) -> None:
        """``laws`` by joint name; all bristles start unbent."""
        self._dofs = np.array([model.joint(joint).dofadr[0] for joint in laws], int)
        self._armature = model.dof_armature[self._dofs]
        self._damping = model.dof_damping
        self._q, self._v, self._acceleration, self._applied = data.qpos, data.qvel, data.qacc, data.qfrc_applied
        self._step = model.opt.timestep
        sides = np.array([[law.back() for law in laws.values()], [law.forth() for law in laws.values()]])
        self._level, static, self._viscous = np.moveaxis(sides.reshape(2, -1, 3), 2, 0)
        self._rise = static - self._level
        shape = [
            (law.stribeck_speed, law.load_factor, law.variation, law.period, law.deflection) for law in laws.values()
        ]
        self._stribeck, self._load_factor, self._variation, self._period, deflection = np.array(shape).reshape(-1, 5).T
        self._stiffness = static[1] / deflection
        self._columns = np.arange(len(laws))
        self._z, self._load, self._resistance, self._given = np.zeros((4, len(laws)))
        self._slipping = np.ones(len(laws))

    def act(self) -> None:
        """Subtract friction from ``qfrc_applied`` for the step to come."""
        dofs, h = self._dofs, self._step
        if not dofs.size:
            return
        v = self._v[dofs]
        side = (v >= 0.0).astype(int), self._columns
        g = self._level[side] + self._rise[side] * np.exp(-((v / self._stribeck) ** 2))
        g *= 1.0 + self._variation * np.sin(2.0 * np.pi / self._period * self._q[dofs])
        g += self._load_factor * np.abs(self._load)
        self._slipping = g / self._stiffness
        dz, left = self._change(v)
        bristle = self._stiffness * (self._z + dz * (1.0 + MICRO_DAMPING / h))
        slope = np.copysign(self._z, self._z * v) / self._slipping
        slope = self._stiffness * (h + MICRO_DAMPING) * left * np.maximum(1.0 - slope, 0.0)
        viscous = self._viscous[side]
        self._given, self._resistance = self._applied[dofs], bristle + viscous * v
        self._applied[dofs] -= bristle - slope * v
        self._damping[dofs] = slope + viscous

    def slip(self) -> None:
        """Move the bristles by the step just made, and note the torque that was handed to each link."""
        if not self._dofs.size:
            return
        self._z += self._change(self._v[self._dofs])[0]
        self._load = self._given - self._resistance - self._armature * self._acceleration[self._dofs]

    def _change(self, v: NDArray) -> tuple[NDArray, NDArray]:
        """Exact change of z over a step at constant v, and the share of the old deflection that is left."""
        decay = np.expm1(-self._step * np.abs(v) / self._slipping)
        return (self._z - np.copysign(self._slipping, v)) * decay, 1.0 + decay
