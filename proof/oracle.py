"""The oracle: what the tool's own fit leaves of the same arm with nothing concealed in it.

Nobody can ask a name to close more than this. The floor of disturbance and noise can lie far lower: identified numbers
have errors, and no law of friction tells what a joint that stood still before the recording began holds.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .cases import RATE, THIRD, draw
from .plant import band_rms, floor
from .third import left


@dataclass(frozen=True)
class Wanted:
    """A case by what it is drawn from, and the bands [Hz] in which its oracle is wanted; none where nothing closes."""

    plan: tuple[str, tuple[str, ...], float]
    seed: int
    number: int
    attempt: int
    bands: tuple[float, ...]


def run(wanted: Wanted) -> dict[str, Any]:
    """``over_floor``: for each band the error on the third recording of every channel over its floor.

    ``none`` says why there is no oracle, where its arm cannot be recorded; the floor stands for it then.
    """
    if not wanted.bands:
        return {"over_floor": []}
    case = draw(wanted.plan, wanted.seed, wanted.number, wanted.attempt)
    lowest = floor(case.twin, THIRD, RATE, case.noise[2])
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            replace(case, plant=case.twin, model=case.twin_model).write(folder)
        except ValueError as error:
            return {"over_floor": [{} for _ in wanted.bands], "none": str(error)}
        for band in wanted.bands:
            own = left(folder, folder / "arm.toml", band, refit=True)
            least = band_rms(lowest, RATE, band)
            found.append({channel: x / float(least[k]) for k, (channel, x) in enumerate(own.items())})
    return {"over_floor": found}


def over_floor(oracle: Mapping[str, float], channels: Sequence[str]) -> float:
    """Error over its floor, root mean square of the channels; 1 where there is no oracle."""
    return float(np.sqrt(np.mean(np.square([oracle.get(c, 1.0) for c in channels])))) if channels else 1.0
