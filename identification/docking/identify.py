"""Every parameter of a docking's effects from recordings, with its standard deviation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...models.model import Model
from ..evidence.weighed import WeighedRecordings
from ..parameter_list import parameter_list
from ..simulated import demand_one_process
from ..sources.answer import estimates, rms, with_found
from ..sources.fit import deviations, linearised
from ..sources.own import fitted, known
from ..sources.source import Linearisation, ModelPoint
from ..sources.weigh import covariances
from .recording import unit_of
from .source import Dockings, start


@dataclass(frozen=True)
class DockingIdentification:
    """A fit of docking tests, the model with its values, and the recordings."""

    model: Model
    given: ModelPoint
    source: Dockings
    weighed: WeighedRecordings
    fit: Linearisation
    held: Linearisation | None

    def to_json(self) -> dict[str, Any]:
        """The published form."""
        source, noise = self.source, covariances(self.weighed)
        parameters = parameter_list(self.fit.at.placed, estimates(source, self.given, self.fit, noise))
        fits: dict[str, Any] = {}
        for role, numbers, found in (("train", source.train, self.fit), ("holdout", source.held, self.held)):
            if found is not None:
                for channel, a, b in zip(source.channels, rms(found), source.sizes(numbers), strict=True):
                    entry = fits.setdefault(channel, {"unit": unit_of(channel)})
                    entry[role] = {"rms": float(a), "relative": float(a / b)}
        _, own = deviations(source, self.given, self.fit, noise)
        size = np.sqrt(np.maximum(np.diag(own), 1e-300))
        condition = float(min(np.linalg.cond(own / np.outer(size, size)), 1e300)) if len(own) else 1.0
        notes = [f"{Path(r.path).name}: {note}" for r in source.records for note in r.notes]
        return {
            "model": self.model.name, "parameters": parameters, "fit": fits, "condition": condition, "notes": notes
        }  # fmt: skip


def identify_dockings(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: Sequence[str | Path] = (),
    *,
    progress: Callable[[str], None] = lambda _: None,
    jobs: int | None = None,
) -> DockingIdentification:
    """Fit every parameter of a docking's effects; arguments and errors as `diagnose_dockings`."""
    demand_one_process(model, jobs)
    progress("reading the recordings")
    source, given = Dockings(model, recordings, holdout), known(model, start(model))
    progress("fitting the effects' parameters with the simulation in the loop")
    weighed, found = fitted(source, given, start(model))
    held = linearised(source, source.held, found.at) if holdout else None
    return DockingIdentification(with_found(model, found.at), given, source, weighed, found, held)
