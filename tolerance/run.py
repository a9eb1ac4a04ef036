"""Run the cases of a study on Dask workers, record each as it ends, and choose the next ones from what is known."""

import logging
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from scipy.stats import qmc

from ..errors import InputError
from ..report.words import percent
from .boundary import Boundary, fit_boundary
from .capture import Outcome, run_case
from .rays import STAGE, most_cases, next_cases
from .results import Results
from .study import LARGEST, Study
from .summary import nominal_point, to_unit

Say = Callable[[str], None]
WATCH = 10.0
"""How often the workers are looked after while cases run [s]."""


def run_study(
    study: Study, results: Results, *, jobs: int = 2, scheduler: str | None = None, say: Say = lambda text: None
) -> None:
    """Run every case that is not recorded yet.

    Parameters
    ----------
    study, results
    jobs : int
        Worker processes of the local cluster.
    scheduler : str, optional
        Address of a running Dask scheduler to use instead.
    say : callable
        Takes progress lines.

    Raises
    ------
    InputError
        The scheduler cannot be reached, or the disk is full; finished cases are kept.
    """
    with _client(jobs, scheduler) as client:
        run = _Runner(study, results, client, say)
        if study.box:
            run.stage("box", box_points(study), study.box_cases)
        while study.envelope and (wanted := next_cases(study, results.table(STAGE))):
            run.cases(STAGE, wanted)
        if study.sampling == "latin_hypercube":
            cube = qmc.LatinHypercube(len(study.ranges), rng=study.seed).random(study.cases)
            run.stage("space", study.scaled(cube), study.cases)
            return
        adaptive = study.sampling == "adaptive"
        count = min(study.batch, study.cases) if adaptive else study.cases
        run.stage("space", study.scaled(sobol_points(study, count)), count)
        was = np.inf
        while adaptive:  # replayed from the start when a killed run goes on: batches depend on complete batches only
            boundary = space_boundary(study, results, count)
            width = boundary.width()
            say(f"{count} cases: {percent(width, 3)} of the range undecided, wanted {percent(study.width, 3)}")
            if max(width, was) <= study.width or count >= study.cases:
                return  # narrow twice running: one batch can flatter the process
            was = width
            size = min(study.batch, study.cases - count)
            run.stage("space", study.scaled(boundary.next_cases(size, study.seed + count)), size, first=count)
            count += size


def space_boundary(
    study: Study, results: Results, cases: int | None = None, others: tuple[str, ...] = ("box",)
) -> Boundary:
    """The boundary from the (first ``cases``) recorded cases over the whole range, and those of other stages.

    Of each, `LARGEST` at most are taken.
    """
    parts = [results.table("space").iloc[:cases], *map(results.table, others)]
    names = [*study.ranges, "margin"]
    points = np.vstack([part.iloc[:LARGEST][names].to_numpy(float) for part in parts])
    return fit_boundary(to_unit(study, points[:, :-1]), points[:, -1], study.seed)


class _Runner:
    def __init__(self, study: Study, results: Results, client: Any, say: Say) -> None:
        self._study, self._results, self._client, self._say = study, results, client, say
        self._begun, self._ran = time.monotonic(), 0
        self._most_on_rays = most_cases(study)

    def stage(self, stage: str, points: np.ndarray, count: int, first: int = 0) -> None:
        """Run cases ``first`` to ``first + count`` of a stage; points of the varied axes, shape (count, n_ranges)."""
        size = self._study.batch
        for start in range(0, count, size):
            self.cases(stage, {first + n: points[n] for n in range(start, min(start + size, count))})

    def cases(self, stage: str, points: Mapping[int, np.ndarray]) -> None:
        """Run cases together, by their numbers, at points of the varied axes (n_ranges,)."""
        study, results = self._study, self._results
        most = study.cases + (study.box_cases if study.box else 0) + self._most_on_rays
        wanted = {n: study.values(point) for n, point in points.items() if not results.done(stage, n)}
        for number, outcome in self._outcomes(wanted):
            results.add(stage, number, wanted[number], outcome)
            self._ran += 1
            rate = self._ran / (time.monotonic() - self._begun)
            self._say(f"{len(results)} of at most {most} cases recorded, {3600 * rate:.0f} an hour")
        results.merge(stage, list(points))

    def _outcomes(self, wanted: Mapping[int, Mapping[str, float]]) -> Iterator[tuple[int, Outcome]]:
        """Outcomes as they come; a case whose worker was killed is tried again by itself, for it may be innocent."""
        suspects = []
        for number, outcome in self._together(wanted):
            if outcome is None:
                suspects.append(number)
            else:
                yield number, outcome
        for number in sorted(suspects):
            for _, outcome in self._together({number: wanted[number]}):
                yield number, outcome or Outcome.failed("its worker was killed each time it was tried (out of memory?)")

    def _together(self, wanted: Mapping[int, Mapping[str, float]]) -> Iterator[tuple[int, Outcome | None]]:
        from dask.distributed import as_completed

        futures = {self._client.submit(run_case, self._study.capture, v, pure=False): n for n, v in wanted.items()}
        while futures:
            try:
                for future in as_completed(list(futures), timeout=WATCH):
                    outcome = _outcome_of(future)
                    yield futures.pop(future), outcome
            except TimeoutError:
                self._mend()

    def _mend(self) -> None:
        """Replace workers of this machine that are gone for good; say where there is none to wait for."""
        cluster = self._client.cluster
        if cluster is not None:
            cluster.scale(len(cluster.worker_spec))  # Dask restarts a worker that was killed, but not when that fails
        if not self._client.scheduler_info()["workers"]:
            self._say("no worker at the scheduler; waiting for one")


def _outcome_of(future: Any) -> Outcome | None:
    """What came of a case; None where its worker was killed.

    It is asked for once: an outcome lies with the worker that made it, and where that one dies first, Dask runs the
    case again, which may then end otherwise than it had.
    """
    from dask.distributed import KilledWorker

    try:
        return future.result()
    except KilledWorker:
        return None
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"a worker cannot run a case: {error}; has it the same snarelab installed?") from None


def sobol_points(study: Study, count: int) -> np.ndarray:
    """The nominal case, where success is likeliest, then a Sobol set: the first cases see both sides if they can."""
    sampler = qmc.Sobol(len(study.ranges), rng=study.seed)
    cube = sampler.random_base2((count - 1).bit_length())[:count]
    cube[0] = to_unit(study, nominal_point(study)[None, :])[0]
    return cube


def box_points(study: Study) -> np.ndarray:
    """Cases drawn evenly from the box, or at its ends; ranges outside the box are drawn whole."""
    unit = np.random.default_rng([study.seed, 1]).random((study.box_cases, len(study.ranges)))
    if study.box_ends:
        boxed = [name in study.box for name in study.ranges]
        unit[:, boxed] = np.round(unit[:, boxed])
    low, high = np.array([study.box.get(name, limits) for name, limits in study.ranges.items()]).T
    return low + unit * (high - low)


def local_cluster(jobs: int) -> Any:
    """Worker processes of this machine, one thread each; its ports are free ones, so that studies run side by side."""
    from dask.distributed import LocalCluster

    options: dict[str, Any] = {"dashboard_address": None, "scheduler_kwargs": {"dashboard_address": "127.0.0.1:0"}}
    with _ignored_interrupt():
        return LocalCluster(n_workers=jobs, threads_per_worker=1, silence_logs=logging.CRITICAL, **options)


@contextmanager
def _ignored_interrupt() -> Iterator[None]:
    """Processes that are started meanwhile never see Ctrl-C: this one ends them, and they say nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _client(jobs: int, scheduler: str | None) -> Iterator[Any]:
    if scheduler is None:
        from dask.distributed import Client

        with local_cluster(jobs) as cluster, Client(cluster) as client:
            yield client
        return
    with _reached(scheduler) as client:
        yield client


def demand_scheduler(address: str) -> None:
    """Refuse an address where no scheduler answers (InputError)."""
    _reached(address).close()


def _reached(address: str) -> Any:
    from dask.distributed import Client

    try:
        return Client(address, timeout="5s")
    except (OSError, TimeoutError, ValueError) as error:
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"scheduler {address!r} cannot be reached: {reason}; is it running there?") from None
