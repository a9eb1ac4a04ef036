"""Simulated captures: one run from values of effects to a `Track`, many side by side in processes, none twice."""

import os
import signal
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from types import TracebackType

from ...errors import InputError
from ...models.snare.ring_drive import RingDrive
from ...models.snare.setup import CaptureSetup
from .recording import EVERY, CaptureRecording, Start, Track

SEARCH = (5e-3, 6, 1e-3)
"""Step [s], elements per cable and first steps [s] in a search: within 0.1 mm of finer ones over a capture."""
FINER = (1e-3, 10, 2.5e-4)
"""Step [s], elements per cable and first steps [s] where `SEARCH` does not converge."""

MOST_LOST = 3
"""Times that processes which died are replaced."""

Values = Mapping[str, float]
Asked = tuple[int, Values, tuple[float, ...]]
"""A simulation: the capture's number, effects' values, and what its start velocity is off by (3,) [deviations]."""
Key = tuple[int, tuple[tuple[str, float], ...], tuple[float, ...]]
"""As remembered: values in order of their names, to 12 digits."""


@dataclass(frozen=True)
class Job:
    """A capture as it is to be simulated: set-up, its start, drive, and the number of times in its track."""

    setup: CaptureSetup
    start: Start
    drive: RingDrive | None
    n_times: int


def simulated(job: Job, values: Values, faster: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Track | None:
    """Simulate a capture with values of effects' parameters, its start velocity ``faster`` by so many deviations; None
    where it cannot be, as if nothing were seen."""
    from ...models.snare.model import Accuracy, SnareModel, SnareStepError  # an engine loads only where one runs

    for accuracy in (SEARCH, FINER):
        try:
            setup = job.start.shifted(job.setup, faster).with_values(values)
            model = SnareModel(setup.parameters, setup.target, Accuracy(*accuracy), drive=job.drive)
            history = model.run(EVERY * (job.n_times - 1), every=EVERY)
        except SnareStepError:
            continue
        except InputError:
            return None
        forces = {"effector": history.mean_force, "target": history.mean_pin_force}
        return Track(history.target_position, history.target_quaternion, forces)
    return None


_jobs: tuple[Job, ...] = ()


def _begin(jobs: tuple[Job, ...]) -> None:
    global _jobs
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent answers for an interrupt
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _jobs = jobs


def _end_with_parent() -> None:
    """A parent that was killed has nobody else to end its processes."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run(number: int, values: Values, faster: tuple[float, ...]) -> Track | None:
    return simulated(_jobs[number], values, faster)


class CaptureRuns:
    """Simulations of some captures; a context, which ends its processes.

    Parameters
    ----------
    captures : sequence of CaptureRecording
    workers : int
        Processes; 1 runs everything in this one.
    """

    def __init__(self, captures: Sequence[CaptureRecording], workers: int = 2) -> None:
        """Start nothing yet."""
        self._jobs = tuple(Job(c.setup, c.start, c.drive, len(c.times)) for c in captures)
        self._workers = workers
        self._pool: ProcessPoolExecutor | None = None
        self._lost = 0
        self._known: dict[Key, Track | None] = {}

    def __enter__(self) -> "CaptureRuns":
        """Ready."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes, at once after an interrupt."""
        if self._pool is None:
            return
        processes = list((getattr(self._pool, "_processes", None) or {}).values())
        self._pool.shutdown(wait=kind is None, cancel_futures=True)
        if kind is not None:
            for process in processes:
                process.terminate()

    @property
    def count(self) -> int:
        """Simulations run so far."""
        return len(self._known)

    def __call__(self, asked: Sequence[Asked]) -> list[Track | None]:
        """Tracks, in order; what was run before is remembered."""
        keys = [(n, tuple(sorted((k, float(f"{v:.12g}")) for k, v in x.items())), faster) for n, x, faster in asked]
        new = [key for key in dict.fromkeys(keys) if key not in self._known]
        if self._workers == 1 or (len(new) == 1 and self._pool is None):
            for key in new:
                self._known[key] = simulated(self._jobs[key[0]], dict(key[1]), key[2])
        while left := [key for key in new if key not in self._known]:
            try:
                self._share_out(left)
            except BrokenProcessPool:
                # A process that died, for want of memory say, is replaced; not for ever.
                self._pool, self._lost = None, self._lost + 1
                if self._lost > MOST_LOST:
                    raise
        return [self._known[key] for key in keys]

    def _share_out(self, keys: Sequence[Key]) -> None:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(self._workers, get_context("spawn"), _begin, (self._jobs,))
        waiting: list[Future[Track | None]] = [self._pool.submit(_run, n, dict(x), faster) for n, x, faster in keys]
        for key, future in zip(keys, waiting, strict=True):
            self._known[key] = future.result()
