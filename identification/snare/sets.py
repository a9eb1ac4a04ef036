"""Captures that are fitted together, and those held out, with the simulations that both share."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ...errors import InputError
from ...models.model import Model
from .handles import values_of
from .library import start_of
from .recording import CaptureRecording, Track, check_sensors, load_captures, sensed_by
from .runs import CaptureRuns, Values


@dataclass(frozen=True)
class CaptureSet:
    """Some of the captures that are simulated: their numbers in the runs, and themselves."""

    runs: CaptureRuns
    numbers: Sequence[int]
    captures: Sequence[CaptureRecording]

    def tracks_at(self, many: Sequence[Values]) -> list[list[Track | None]]:
        """Tracks of all the captures for each of many sets of values."""
        flat = self.runs([(n, values) for values in many for n in self.numbers])
        return [flat[i : i + len(self.numbers)] for i in range(0, len(flat), len(self.numbers))]


@contextmanager
def sets_of(
    model: Model, recordings: Sequence[str | Path], holdout: Sequence[str | Path], jobs: int | None
) -> Iterator[tuple[CaptureSet, CaptureSet]]:
    """Captures that are fitted, and those held out, for as long as their processes run.

    Each has its force sensor where its sign says, in a simulation of the model as it comes.
    """
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs}; allowed is a whole number from 1")
    if not recordings:
        raise InputError("recordings: none is given; give one or more")
    captures = load_captures(model, [*recordings, *holdout])
    check_sensors(captures)
    with CaptureRuns(captures, jobs or min(4, os.cpu_count() or 1)) as runs:
        values = values_of(model.effects, start_of(model))
        tracks = runs([(n, values) for n in range(len(captures))])
        captures = [sensed_by(c, track) for c, track in zip(captures, tracks, strict=True)]
        check_sensors(captures)
        n = len(recordings)
        yield CaptureSet(runs, range(n), captures[:n]), CaptureSet(runs, range(n, len(captures)), captures[n:])
