"""Every parameter of a capture's effects from recordings, with its standard deviation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...models.model import Model
from ..parameter_list import parameter_list
from .answer import estimates, with_found
from .channels import channel_errors
from .fit import CaptureFit, evaluate, fit, normal, with_slopes
from .recording import CaptureRecording
from .search import demand_simulated, start_at
from .sets import sets_of

STEPS = 8
"""Most steps of the fit."""


@dataclass(frozen=True)
class CaptureIdentification:
    """A fit of captures, the model with its values, and the recordings."""

    model: Model
    fit: CaptureFit
    train: tuple[CaptureRecording, ...]
    holdout: tuple[CaptureRecording, ...]
    held: CaptureFit | None

    def to_json(self) -> dict[str, Any]:
        """The published form."""
        parameters = parameter_list(self.fit.placed, estimates(self.train, self.fit))
        fits: dict[str, Any] = {}
        for role, captures, found in (("train", self.train, self.fit), ("holdout", self.holdout, self.held)):
            if found is not None:
                for error in channel_errors(captures, found):
                    entry = fits.setdefault(error.channel, {})
                    entry[role] = {"rms": error.rms, "relative": error.relative}
                    entry["unit"] = error.unit
        matrix = normal(self.train, self.fit)[1] if len(self.fit.x) else np.eye(1)
        notes = [f"{Path(c.path).name}: {note}" for c in (*self.train, *self.holdout) for note in c.notes]
        return {
            "model": self.model.name,
            "parameters": parameters,
            "fit": fits,
            "condition": float(min(np.linalg.cond(matrix), 1e300)),
            "notes": notes,
        }


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
    with sets_of(model, recordings, holdout, jobs) as (train, locked):
        progress("fitting the effects' parameters with the simulation in the loop")
        found = with_slopes(train, fit(train, start_at(model, train), STEPS))
        held = demand_simulated(model, evaluate(locked, found.placed, [found.x])[0]) if holdout else None
    return CaptureIdentification(with_found(model, found), found, tuple(train.captures), tuple(locked.captures), held)
