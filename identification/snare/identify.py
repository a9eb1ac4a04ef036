"""Every parameter of a capture's effects from recordings, with its standard deviation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...models.model import Model
from ..evidence.weighed import WeighedRecordings
from ..parameter_list import parameter_list
from ..sources.answer import estimates, rms
from ..sources.fit import deviations, linearised
from ..sources.own import fitted, known
from ..sources.source import Linearisation, ModelPoint
from ..sources.weigh import covariances
from .answer import with_found
from .seen import shown, unit_of
from .source import Captures, captures_of, start


@dataclass(frozen=True)
class CaptureIdentification:
    """A fit of captures, the model with its values, and the recordings."""

    model: Model
    given: ModelPoint
    source: Captures
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
                left, size = rms(found), source.sizes(numbers)
                for c in shown(source.channels):
                    entry = fits.setdefault(source.channels[c], {})
                    entry[role] = {"rms": float(left[c]), "relative": float(left[c] / size[c])}
                    entry["unit"] = unit_of(source.channels[c])
        _, own = deviations(source, self.given, self.fit, noise)
        size = np.sqrt(np.maximum(np.diag(own), 1e-300))
        condition = float(min(np.linalg.cond(own / np.outer(size, size)), 1e300)) if len(own) else 1.0
        notes = [f"{Path(r.path).name}: {note}" for r in source.records for note in r.notes]
        return {
            "model": self.model.name, "parameters": parameters, "fit": fits, "condition": condition, "notes": notes
        }  # fmt: skip


def identify_captures(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: Sequence[str | Path] = (),
    *,
    progress: Callable[[str], None] = lambda _: None,
    jobs: int | None = None,
) -> CaptureIdentification:
    """Fit every parameter of a capture's effects; arguments and errors as `diagnose_captures`."""
    progress("reading the recordings")
    with captures_of(model, recordings, holdout, jobs) as source:
        progress("fitting the effects' parameters with the simulation in the loop")
        given = known(model, start(model, len(source.records)))
        weighed, found = fitted(source, given, start(model, len(source.records)))
        held = linearised(source, source.held, found.at) if holdout else None
        return CaptureIdentification(with_found(model, found.at), given, source, weighed, found, held)
