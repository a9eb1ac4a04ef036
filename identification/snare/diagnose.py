"""Diagnosis of captures, from recordings to the verdict."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from ...models.model import Model
from ...recordings.part import several
from ..diagnosis import Diagnosis
from .answer import report_on, with_found
from .search import search
from .sets import sets_of


def diagnose_captures(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: str | Path | Sequence[str | Path],
    *,
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
    jobs: int | None = None,
) -> tuple[Diagnosis, Model]:
    """Find, name, add and confirm the physics that a capture's model leaves out.

    Parameters
    ----------
    model : Model
        Of a capture.
    recordings : sequence of path
    holdout : path, or sequence of them
        Looked at for the proof only.
    progress : callable
    seed : int
        Of the bootstrap.
    jobs : int or None
        Processes; None: one a core, at most four.

    Returns
    -------
    the diagnosis, and the model with what it found

    Raises
    ------
    InputError
        Whatever is wrong with a recording, or a model that cannot be simulated from where it starts.
    """
    begun = time.monotonic()
    progress("reading the recordings")
    with sets_of(model, recordings, several(holdout), jobs) as (train, locked):
        found = search(model, train, locked, progress=progress, seed=seed)
    seconds, count = time.monotonic() - begun, train.runs.count
    return report_on(model, found, train.captures, locked.captures, seconds, count), with_found(model, found.last)
