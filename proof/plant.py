"""The bench's closed-loop plant, with what its parts do not have: torques of any law, and arms unlike their URDF."""

# pyright: reportAttributeAccessIssue=false
# (pyright does not see the names that mujoco takes from its compiled module)
import copy
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from unittest.mock import patch

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from bench.arm import Arm
from bench.motion import Motion
from bench.mujoco_plant import CONTROL_RATE, Plant, _disturbance, simulate

SETTLE = 1.0
"""Time before a recording starts, at rest [s]."""

Law = Callable[[float, NDArray, NDArray], NDArray]
"""Time from the recording's start [s], q and qd (n_joints,): torque that the joints are pushed with (n_joints,)."""


@dataclass(frozen=True, eq=False)
class ProofPlant(Plant):
    """A plant with more to conceal.

    Parameters
    ----------
    real : Arm or None
        What the arm is, where the nominal arm, which URDF and servo believe in, is wrong.
    laws : tuple of Law
        Torques on the joints, beside all others.
    q_delay : float
        Time by which the logged position lags [s]; the servo's own reading does not.
    """

    real: Arm | None = None
    laws: tuple[Law, ...] = ()
    q_delay: Mapping[str, float] = field(default_factory=dict)

    def model(self, timestep: float) -> mujoco.MjModel:
        """As the bench's, of the real arm."""
        return super().model(timestep) if self.real is None else replace(self, arm=self.real, real=None).model(timestep)


def record(
    plant: ProofPlant, motion: Motion, duration: float, rate: float, rng: np.random.Generator
) -> dict[str, NDArray]:
    """Run the plant in MuJoCo and record it: ``time``, ``q.<joint>``, ``tau.<joint>``, each (n_samples,)."""
    with _pushed(plant):
        recording = simulate(plant, motion, duration, rate, rng, settle=SETTLE)
    time = recording["time"]
    for joint, delay in plant.q_delay.items():
        recording[f"q.{joint}"] = CubicSpline(time, recording[f"q.{joint}"])(np.maximum(time - delay, time[0]))
    return recording


def floor(plant: ProofPlant, duration: float, rate: float, rng: np.random.Generator) -> NDArray:
    """What no model can explain of the recording that ``record`` makes with this generator: (n_samples, n_joints) [T].

    The torque channel's noise, less the disturbance, which the drive has to supply the opposite of; as the channel's
    gain shows it. ``rng`` is left as it was.
    """
    disturbing, _, sensing = copy.deepcopy(rng).spawn(3)
    first, stride = round(SETTLE * CONTROL_RATE), round(CONTROL_RATE / rate)
    steps = round((SETTLE + duration) * CONTROL_RATE) + 1
    noise = sensing.standard_normal((steps, len(plant.arm.links))) * plant.per_joint("tau_noise")
    return (noise - plant.per_joint("tau_gain", 1.0) * _disturbance(plant, disturbing, steps))[first::stride]


def band_rms(signal: NDArray, rate: float, band: float) -> NDArray:
    """RMS (n_channels,) of signals (n_samples, n_channels) below ``band`` [Hz]."""
    power = np.abs(np.fft.rfft(signal, axis=0)) ** 2
    power[np.fft.rfftfreq(len(signal), 1.0 / rate) > band] = 0.0
    power[1 : (len(signal) + 1) // 2] *= 2.0
    return np.sqrt(power.sum(axis=0)) / len(signal)


@contextmanager
def _pushed(plant: ProofPlant) -> Iterator[None]:
    """Every MuJoCo step adds the plant's laws to the applied torques first, which the loop sets anew for each."""
    columns: list[int] = []
    plain = mujoco.mj_step

    def step(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if not columns:
            columns.extend(model.joint(joint).dofadr[0] for joint in plant.arm.joints)
        for law in plant.laws:
            data.qfrc_applied[columns] += law(data.time - SETTLE, data.qpos[columns], data.qvel[columns])
        plain(model, data)

    # MuJoCo's own callbacks cannot be there while a model is compiled, and the loop compiles two.
    with patch.object(mujoco, "mj_step", step if plant.laws else plain):
        yield
