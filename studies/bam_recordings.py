"""The publishers' recordings of an XL330 servo with a pendulum, and what its firmware makes of a position error."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..models.servo_loop import ServoRun, simulate
from ..recordings import find_recording
from ..recordings.find import SHA256

Array = NDArray[np.float64]

DUTY = 4096 / (2 * np.pi) / (256 * 885)
"""Duty per controller gain and radian: 4096 counts a turn, a divisor of 256, 885 counts of full duty."""

HELD_OUT = 400.0
"""Controller gain whose recordings are held out, as in the publication."""


@dataclass(frozen=True)
class BamRun(ServoRun):
    """A recording with its trajectory, the firmware's gain, and duty as measured (n,)."""

    trajectory: str
    kp: float
    duty: Array


def read_run(path: Path) -> BamRun:
    """Read one of the publishers' JSON files.

    Raises
    ------
    InputError
        It is damaged, or an entry is missing.
    """
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
        keys = ("timestamp", "position", "goal_position", "torque_enable", "input_volts", "load")
        time, position, goal, on, volts, load = (np.array([e[k] for e in raw["entries"]], float) for k in keys)
        # Duty is a count of 16 bits with a sign.
        duty = np.where(load > 32767, load - 65536, load) / 885
        kp, mass, length = (float(raw[k]) for k in ("kp", "mass", "length"))
        trajectory = str(raw["trajectory"])
        return BamRun(path.name, kp * DUTY, mass, length, time, position, goal, on, volts, trajectory, kp, duty)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: is no recording of the servo ({error!r}); fetch it again") from None


def read_all() -> tuple[list[BamRun], list[BamRun]]:
    """The recordings to fit, and those held out; raises InputError where one cannot be had."""
    runs = [read_run(find_recording(name)) for name in sorted(SHA256) if name.endswith(".json")]
    return [r for r in runs if r.kp != HELD_OUT], [r for r in runs if r.kp == HELD_OUT]


def position_error(runs: Sequence[ServoRun], values: Mapping[str, float]) -> float:
    """Mean absolute error of the simulated position, the mean over recordings [rad]; ``values`` as in `simulate`."""
    return float(np.mean([np.mean(np.abs(simulate(r, values) - r.position)) for r in runs]))


def duty_error(runs: Sequence[BamRun]) -> float:
    """RMS of recorded duty less what the firmware's law makes of goal and position, while the drive is on [1]."""
    parts = [(np.clip(r.gain * (r.goal - r.position), -1, 1) - r.duty)[r.on > 0.5] for r in runs]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
