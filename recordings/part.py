"""A part of a recording, as ``run.csv@2.5:10``: samples from 2.5 s to just before 10 s of its clock, ends optional.

Rows that a fit sees and rows that it does not may so come from one file.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from ..errors import InputError

_NUMBER = r"-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?"
_PART = re.compile(rf"(?P<file>.+)@(?P<start>{_NUMBER})?:(?P<stop>{_NUMBER})?")


@dataclass(frozen=True)
class Part:
    """A file, and the time [s] from which, and before which, samples count; infinite where there is no end."""

    file: Path
    start: float = -np.inf
    stop: float = np.inf

    def overlaps(self, other: "Part") -> bool:
        """Whether two parts of one file overlap."""
        return self.file.resolve() == other.file.resolve() and self.start < other.stop and other.start < self.stop

    def __call__(self, dataset: xr.Dataset) -> xr.Dataset:
        """The samples of a recording that belong to it; raises InputError where these are fewer than two."""
        time = dataset["time"].to_numpy()
        inside = (time >= self.start) & (time < self.stop)
        if inside.all():
            return dataset
        if np.count_nonzero(inside) < 2:
            raise InputError(
                f"{self.file}: holds {time[0]:g} s to {time[-1]:g} s, of which {self.start:g} s to {self.stop:g} s is "
                "too little; give a part with samples"
            )
        return dataset.isel(time=np.flatnonzero(inside))


def part_of(path: str | Path) -> Part:
    """The file and part that a recording's path names: a whole file of that name, if there is one, else a part."""
    plain, match = Path(path), _PART.fullmatch(str(path))
    if match is None or plain.exists():
        return Part(plain)
    start, stop = match["start"], match["stop"]
    found = Part(
        Path(match["file"]), -np.inf if start is None else float(start), np.inf if stop is None else float(stop)
    )
    if found.start >= found.stop:
        raise InputError(
            f"{path}: the part from {found.start:g} s to {found.stop:g} s is empty; write it as FILE@FROM:TO"
        )
    return found


def several(recordings: str | Path | Sequence[str | Path]) -> tuple[str | Path, ...]:
    """One recording or several, as several."""
    return (recordings,) if isinstance(recordings, str | Path) else tuple(recordings)
