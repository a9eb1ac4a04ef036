"""Diagnosis of captures, from recordings to the verdict."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from ...models.model import Model
from ...recordings.part import several
from ..diagnosis import Diagnosis
from ..sources.decide import decide
from ..sources.own import settled
from .answer import report_on, with_found
from .source import captures_of, start


def diagnose_captures(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: str | Path | Sequence[str | Path],
    *,
    progress: Callable[[str], None] = lambda _: None,
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
    with captures_of(model, recordings, several(holdout), jobs) as source:
        decided = decide(source, settled(source, model, start(model, len(source.records)), progress), progress)
        # What was named step by step is fitted again, while there are processes to simulate in.
        answer = report_on(source, decided, time.monotonic() - begun)
    return answer, with_found(model, decided.train.at)
