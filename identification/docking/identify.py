"""Every parameter of a docking's effects from recordings, with its standard deviation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...models.docking.bench_setup import DockingTree
from ...models.model import Model
from ..parameter_list import parameter_list
from .answer import channel_rms, channel_sizes, estimates, with_found
from .fit import Linear, fit, linearised, normal, priors, shift_columns, start
from .recording import Record, load_records, unit_of
from .runs import Runs
from .weigh import Weighed, covariances, weigh

STEPS = 8
"""Most steps of the fit."""


@dataclass(frozen=True)
class IdentifiedDockings:
    """A fit of docking tests, the model with its values, and the recordings."""

    model: Model
    given: Model
    runs: Runs
    weighed: Weighed
    fit: Linear
    train: tuple[Record, ...]
    holdout: tuple[Record, ...]
    held: Linear | None

    def to_json(self) -> dict[str, Any]:
        """The published form."""
        parameters = parameter_list(self.fit.at.placed, estimates(self.given, self.fit, self.weighed))
        fits: dict[str, Any] = {}
        for role, records, found in (("train", self.train, self.fit), ("holdout", self.holdout, self.held)):
            if found is not None:
                rms, sizes = channel_rms(found), channel_sizes(records)
                for channel, a, b in zip(records[0].channels, rms, sizes, strict=True):
                    entry = fits.setdefault(channel, {"unit": unit_of(channel)})
                    entry[role] = {"rms": float(a), "relative": float(a / b)}
        _, matrix = normal(self.fit, covariances(self.weighed), priors(self.given, self.fit.at))
        own = matrix[: len(self.fit.at.values), : len(self.fit.at.values)]
        size = np.sqrt(np.maximum(np.diag(own), 1e-300))
        condition = float(min(np.linalg.cond(own / np.outer(size, size)), 1e300)) if len(own) else 1.0
        notes = [f"{Path(r.path).name}: {note}" for r in (*self.train, *self.holdout) for note in r.notes]
        return {
            "model": self.model.name, "parameters": parameters, "fit": fits, "condition": condition, "notes": notes
        }  # fmt: skip


def identify_dockings(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: Sequence[str | Path] = (),
    *,
    progress: Callable[[str], None] = lambda _: None,
) -> IdentifiedDockings:
    """Fit every parameter of a docking's effects; arguments and errors as `diagnose_dockings`."""
    assert isinstance(model.tree, DockingTree)
    if not recordings:
        raise InputError("recordings: none is given; give one or more")
    progress("reading the recordings")
    records = load_records(model, [*recordings, *holdout])
    runs, n = Runs(model.tree.setup, records), len(recordings)
    progress("fitting the effects' parameters with the simulation in the loop")
    here = linearised(runs, range(n), start(model))
    weighed = weigh(runs, range(n), model, here, search=False)
    found = fit(runs, range(n), model, here.at, covariances(weighed), shift_columns(here), STEPS)
    held = linearised(runs, range(n, len(records)), found.at) if holdout else None
    return IdentifiedDockings(
        with_found(model, found), model, runs, weighed, found, tuple(records[:n]), tuple(records[n:]), held
    )
