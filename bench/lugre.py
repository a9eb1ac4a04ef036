"""LuGre friction on MuJoCo joints, with its bristles integrated inside the loop."""

# pyright: reportAttributeAccessIssue=false
# (pyright does not see the names that mujoco takes from its compiled module)
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numba
import numpy as np

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
        """Level, static level and viscous coefficient for qd < 0.

        Where only ``level_negative`` is given, the static level keeps its ratio to it."""
        level, static, viscous = self.forth()
        low = level if self.level_negative is None else self.level_negative
        high = static * low / level if self.static_negative is None else self.static_negative
        return low, high, viscous if self.viscous_negative is None else self.viscous_negative


# Rows of what a run's joints are (constants, then what changes); a column a joint.
LEVEL, RISE, VISCOUS = 0, 2, 4  # two rows each: for qd < 0 and for qd >= 0
STRIBECK, LOAD_FACTOR, VARIATION, WAVE, STIFFNESS, ARMATURE = range(6, 12)
Z, LOAD, RESISTANCE, GIVEN, SLIPPING = range(5)


class Bristles:
    """The LuGre joints of one run: ``act`` before each MuJoCo step, ``slip`` after it.

    The torque is made implicit in the speed by handing MuJoCo its derivative as this step's damping (``implicitfast``
    must be the integrator): the bristles are stiff enough to blow up an explicit step on a light link.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, laws: Mapping[str, LuGre]) -> None:
        """``laws`` by joint name; all bristles start unbent."""
        self._joints = list(laws)
        self._dofs = np.array([model.joint(joint).dofadr[0] for joint in laws], int)
        self._step = model.opt.timestep
        self._acting = data.qpos, data.qvel, data.qfrc_applied, model.dof_damping
        self._moved = data.qvel, data.qacc
        rows = [
            [value for pair in zip(law.back(), law.forth(), strict=True) for value in pair]
            + [law.stribeck_speed, law.load_factor, law.variation, 2.0 * np.pi / law.period]
            + [law.forth()[1] / law.deflection]
            for law in laws.values()
        ]
        self._law = np.vstack([np.array(rows).reshape(-1, ARMATURE).T, model.dof_armature[self._dofs]])
        self._law[[2, 3]] -= self._law[[0, 1]]
        self._state = np.zeros((5, len(laws)))
        self._state[SLIPPING] = 1.0

    def act(self) -> None:
        """Subtract friction from ``qfrc_applied`` for the step to come."""
        _act(self._dofs, self._step, self._law, self._state, *self._acting)

    def resistance(self, joint: str) -> float:
        """Friction of a joint [T] that ``act`` subtracted, viscous part and all: positive where the joint moves on."""
        return float(self._state[RESISTANCE, self._joints.index(joint)])

    def slip(self) -> None:
        """Move the bristles by the step just made, and note the torque that was handed to each link."""
        _slip(self._dofs, self._step, self._law, self._state, *self._moved)


@numba.njit(cache=True, error_model="numpy")
def _act(dofs, h, law, state, q, v, applied, damping):
    for k, dof in enumerate(dofs):
        speed, side = v[dof], int(v[dof] >= 0.0)
        g = law[LEVEL + side, k] + law[RISE + side, k] * np.exp(-((speed / law[STRIBECK, k]) ** 2))
        g *= 1.0 + law[VARIATION, k] * np.sin(law[WAVE, k] * q[dof])
        g += law[LOAD_FACTOR, k] * abs(state[LOAD, k])
        slipping = g / law[STIFFNESS, k]
        state[SLIPPING, k] = slipping
        dz, left = _change(h, state[Z, k], slipping, speed)
        bristle = law[STIFFNESS, k] * (state[Z, k] + dz * (1.0 + MICRO_DAMPING / h))
        slope = np.copysign(state[Z, k], state[Z, k] * speed) / slipping
        slope = law[STIFFNESS, k] * (h + MICRO_DAMPING) * left * max(1.0 - slope, 0.0)
        viscous = law[VISCOUS + side, k]
        state[GIVEN, k], state[RESISTANCE, k] = applied[dof], bristle + viscous * speed
        applied[dof] -= bristle - slope * speed
        damping[dof] = slope + viscous


@numba.njit(cache=True, error_model="numpy")
def _slip(dofs, h, law, state, v, acceleration):
    for k, dof in enumerate(dofs):
        state[Z, k] += _change(h, state[Z, k], state[SLIPPING, k], v[dof])[0]
        state[LOAD, k] = state[GIVEN, k] - state[RESISTANCE, k] - law[ARMATURE, k] * acceleration[dof]


@numba.njit(cache=True, error_model="numpy")
def _change(h, z, slipping, v):
    """Exact change of z over a step at constant v, and the share of the old deflection that is left."""
    decay = np.expm1(-h * abs(v) / slipping)
    return (z - np.copysign(slipping, v)) * decay, 1.0 + decay
