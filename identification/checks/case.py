"""What checks look at: the model, the recordings as read, and samples on which readings are compared."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...models.model import Model
from ...models.tree import Tree
from ...recordings.signals import Signal
from ..fitting.experiment import Experiment
from .evidence import CheckBasis, ReadingFit
from .mend import Mends
from .reading import Reading, Samples, as_read

Array = NDArray[np.float64]

ROWS = 9000
"""Rows (samples times joints) of the fit that compares readings: more change no verdict, only its cost."""

INDEPENDENT = 10.0, 600.0
"""Fewest and most independent samples that a channel counts: what a model leaves out is not white."""

ALL = 8
"""Joints up to which every reading is tried; of larger robots, those of as many channels as fit worst."""


@dataclass(frozen=True, eq=False)
class CheckCase:
    """A model and its recordings.

    Parameters
    ----------
    model : Model
    datasets : sequence of xarray.Dataset
        As read, one a recording, in SI units.
    experiments : sequence of Experiment
        Conditioned, in the same order; those that could be.
    progress : callable
    """

    model: Model
    datasets: Sequence[xr.Dataset]
    experiments: Sequence[Experiment]
    progress: Callable[[str], None] = field(default=lambda _: None)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.model.joints

    @property
    def tree(self) -> Tree:
        """The robot."""
        return self.model.tree

    @cached_property
    def mends(self) -> Mends:
        """Writes lines for the model file."""
        return Mends(self.model, self.datasets[0])

    @property
    def comparable(self) -> bool:
        """Whether readings can be compared: an arm on a fixed base, of which something drives a joint."""
        arm = type(self.tree) is Tree and bool(self.experiments)
        return arm and bool((self.grounds.counted > 0).any())

    @cached_property
    def samples(self) -> Samples:
        """Band-limited samples of all recordings, thinned evenly to `ROWS`."""
        each = max(1, ROWS // len(self.joints) // len(self.experiments))
        parts: list[tuple[Array, ...]] = []
        for e in self.experiments:
            motion = e.motion
            banded = [motion.to_band(x) for x in (motion.q, motion.qd, motion.qdd)] + [e.measured]
            every = max(1, -(-len(banded[0]) // each))
            parts.append(tuple(x[::every] for x in banded))
        q, qd, qdd, tau = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        run = np.repeat(np.arange(len(parts)), [len(part[0]) for part in parts])
        return Samples(q, qd, qdd, tau, run)

    @cached_property
    def grounds(self) -> CheckBasis:
        """What readings are compared on; each channel counts as many samples as its misfit has independent ones."""
        first = self.experiments[0]
        told = np.ones(len(self.joints))
        told[sorted({*first.motion.silent, *first.motion.undriven})] = 0.0
        told[np.std(self.samples.tau, axis=0) == 0] = 0.0
        free = self.model.inertia == "free"
        plain = CheckBasis(first.body, self.samples, free, 50.0 * told)
        if not told.any():  # nothing drives any joint: there is no torque to compare readings by
            return plain
        misfit = plain.fit(as_read(len(self.joints)), bounded=False).residual
        counted = [independent(misfit[:, c], self.samples.run) if told[c] else 0.0 for c in range(len(told))]
        return CheckBasis(first.body, self.samples, free, np.array(counted))

    @cached_property
    def given(self) -> ReadingFit:
        """Fit of the reading that the model file has."""
        return self.grounds.fit(as_read(len(self.joints)))

    @cached_property
    def doubtful(self) -> tuple[int, ...]:
        """Joints whose columns are read in other ways too: all of a small robot, else those that fit worst."""
        if len(self.joints) <= ALL:
            return tuple(range(len(self.joints)))
        order = np.argsort(-np.nan_to_num(self.given.relative))
        return tuple(sorted(int(c) for c in order[:ALL]))

    def signal(self, name: str) -> Signal | None:
        """The entry of [signals], if there is one."""
        return self.model.signals.get(name)

    def reading(self, name: str, at: Sequence[str], message: str, mends: Sequence[str]) -> Reading:
        """A reading of a kind, as read until something is changed."""
        return as_read(len(self.joints)).but(name=name, at=tuple(at), message=message, mends=tuple(mends))


def independent(misfit: Array, run: NDArray[np.int_]) -> float:
    """Independent samples that a misfit has: n over twice its integrated autocorrelation (Geyer's initial sequence)."""
    total = 0.0
    for k in np.unique(run):
        x = misfit[run == k] - np.mean(misfit[run == k])
        n = len(x)
        if n < 4 or not np.any(x):
            continue
        power = np.abs(np.fft.rfft(x, 2 * n)) ** 2
        correlation = np.fft.irfft(power)[:n] / np.arange(n, 0, -1)
        correlation /= correlation[0]
        below = np.flatnonzero(correlation < 0.05)
        length = 1 + 2 * float(np.sum(correlation[1 : below[0] if len(below) else n]))
        total += n / max(length, 1.0)
    return float(np.clip(total, *INDEPENDENT))
