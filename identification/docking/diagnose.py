"""Diagnosis of docking tests, from recordings to the verdict."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from ...models.model import Model
from ...recordings.part import several
from ..diagnosis import Diagnosis
from ..simulated import demand_one_process
from ..sources.answer import with_found
from ..sources.decide import decide
from ..sources.own import settled
from .answer import report_on
from .source import Dockings, start


def diagnose_dockings(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: str | Path | Sequence[str | Path],
    *,
    progress: Callable[[str], None] = lambda _: None,
    jobs: int | None = None,
) -> tuple[Diagnosis, Model]:
    """Find, name, add and confirm the physics that a docking's model leaves out.

    Parameters
    ----------
    model : Model
        Of a docking.
    recordings : sequence of path
    holdout : path, or sequence of them
        Looked at for the proof only.
    progress : callable
    jobs : None
        Dockings are simulated in one process.

    Returns
    -------
    the diagnosis, and the model with what it found

    Raises
    ------
    InputError
        Whatever is wrong with a recording, or a model that cannot be simulated from where it starts.
    """
    demand_one_process(model, jobs)
    begun = time.monotonic()
    progress("reading the recordings")
    source = Dockings(model, recordings, several(holdout))
    decided = decide(source, settled(source, model, start(model), progress), progress)
    diagnosis = report_on(source, model.name, decided, time.monotonic() - begun)
    return diagnosis, with_found(model, decided.train.at)
