"""What the model of a docking leaves out, from recordings to the verdict."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from ...errors import InputError
from ...models.docking.bench_setup import DockingTree
from ...models.model import Model
from ...recordings.part import several
from ..deciding import SECOND_CHOICES
from ..diagnosis import Diagnosis
from .answer import report_on, with_found
from .confirm import confirm
from .recording import load_records
from .runs import Runs
from .search import search


def diagnose_dockings(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: str | Path | Sequence[str | Path],
    *,
    progress: Callable[[str], None] = lambda _: None,
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

    Returns
    -------
    the diagnosis, and the model with what it found

    Raises
    ------
    InputError
        Whatever is wrong with a recording, or a model that cannot be simulated from where it starts.
    """
    assert isinstance(model.tree, DockingTree)
    if not recordings:
        raise InputError("recordings: none is given; give one or more")
    begun = time.monotonic()
    progress("reading the recordings")
    records = load_records(model, [*recordings, *several(holdout)])
    runs = Runs(model.tree.setup, records)
    train, held = range(len(recordings)), range(len(recordings), len(records))
    found = search(runs, train, model, progress=progress)
    best = confirm(runs, train, held, model, found, progress)
    rejected = {n.placed.key: n for n in best.rejected}
    last = best
    for _ in range(SECOND_CHOICES):
        if best.names or not last.rejected:
            break
        progress("looking for what else could explain what the held-out recording did not confirm")
        again = search(runs, train, model, barred=rejected, progress=progress)
        last = confirm(runs, train, held, model, again, progress)
        rejected |= {n.placed.key: n for n in last.rejected}
        if len(last.names) > len(best.names):
            found, best = again, last
    diagnosis = report_on(runs, model, found, best, train, held, time.monotonic() - begun)
    return diagnosis, with_found(model, best.train)
