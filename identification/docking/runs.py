"""Simulated docking tests: one run from values to the channels of a recording, none twice."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...models.docking.bench import DockingBench, DockingCommand, numbers_of
from ...models.docking.bench_setup import FACTORS, MACHINED, REGISTRATION, TOLERANCES, BenchSetup
from ...models.dormand_prince import StepFault
from .recording import DockingRecording

Array = NDArray[np.float64]
Values = Mapping[str, float]

SHIFTS = (*TOLERANCES, *FACTORS, *MACHINED, *REGISTRATION)
"""Numbers of the set-up that may be others than they are said to be, machining, and the pose's registration."""


@cache
def _bench() -> DockingBench:
    """Compiled once in a process."""
    return DockingBench()


class DockingRuns:
    """Simulations of some docking tests."""

    def __init__(self, setup: BenchSetup, records: Sequence[DockingRecording]) -> None:
        """Start nothing yet."""
        self.setup, self.records = setup, tuple(records)
        self._said = numbers_of(setup)
        self._known: dict[tuple[int, tuple[tuple[str, float], ...]], Array | None] = {}

    @property
    def count(self) -> int:
        """Simulations run so far."""
        return len(self._known)

    def __call__(self, number: int, values: Values, shifts: Array) -> Array | None:
        """Channels (n, c) of a recording with effects' values and shifts of `SHIFTS` in their deviations; None where it
        cannot be simulated."""
        seen = self.seen(number, values, shifts)
        return None if seen is None else self.records[number].of(seen)

    def seen(self, number: int, values: Values, shifts: Array) -> Array | None:
        """All that a simulation shows over each stretch of the travel; None where it fails."""
        moved = dict(zip(SHIFTS, map(float, shifts), strict=True))
        own = dict(values) | {k: self._said[k] + moved[k] * x for k, x in TOLERANCES.items() if moved[k]}
        own |= {k: self._said[k] * float(np.exp(moved[k] * x)) for k, x in FACTORS.items() if moved[k]}
        own |= {k: values.get(k, 0.0) + moved[k] * x for k, x in MACHINED.items() if moved[k]}
        own |= {k: moved[k] * x for k, x in REGISTRATION.items() if moved[k]}
        key = number, tuple(sorted((k, float(f"{v:.12g}")) for k, v in own.items()))
        if key not in self._known:
            off = np.array([own.pop(k, 0.0) for k in REGISTRATION])
            try:
                seen = _bench().run(self.setup, own, _registered(self.records[number].motion, off))
                seen[:, :3] += off[:3]
            except (StepFault, InputError):
                seen = None
            self._known[key] = seen if seen is not None and np.all(np.isfinite(seen)) else None
        return self._known[key]


def _registered(motion: DockingCommand, off: Array) -> DockingCommand:
    """The command, started at the end effector's true pose: the measured one is off by this much [m, rad]."""
    if not off.any():
        return motion
    start = Rotation.from_rotvec(-off[3:]) * Rotation.from_quat(motion.quaternion, scalar_first=True)
    return replace(motion, place=motion.place - off[:3], quaternion=start.as_quat(scalar_first=True))
