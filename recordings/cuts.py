"""Samples that a model file leaves out: at times where a recording is cut, and where a channel was cut off."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..errors import InputError

SIDE = 3
"""Samples left out either side of a cut: with six missing, nothing bridges it."""

NEAR = 0.999
"""Share of a channel's limit from which on a sample may have been cut off."""


@dataclass(frozen=True)
class Cuts:
    """Times [s] at which every recording is cut in two, and each channel's level of saturation (its default unit)."""

    breaks: tuple[float, ...] = ()
    limits: Mapping[str, float] = field(default_factory=dict)

    def __call__(self, dataset: xr.Dataset) -> xr.Dataset:
        """The recording with those samples missing; nothing is interpolated there."""
        if not self.breaks and not self.limits:
            return dataset
        time = dataset["time"].to_numpy()
        out = np.zeros(len(time), bool)
        for at in self.breaks:
            if time[0] < at < time[-1]:
                after = int(np.searchsorted(time, at))
                out[max(0, after - SIDE) : after + SIDE] = True
        names = [str(name) for name in dataset.data_vars if str(name).partition(".")[0] in ("q", "tau")]
        made = {name: dataset[name].where(xr.DataArray(~out, dims="time")) for name in names}
        for name, limit in self.limits.items():
            if name in made:
                made[name] = made[name].where(np.abs(made[name]) < NEAR * limit)
        return dataset.assign(made)


def read_cuts(path: Path, raw: Mapping[str, Any], names: Sequence[str]) -> Cuts:
    """The keys ``breaks`` and ``limits`` of a model file; raises InputError where one is not of its kind."""
    breaks, limits = raw.get("breaks", []), raw.get("limits", {})
    if not isinstance(breaks, list) or not all(map(_number, breaks)):
        raise InputError(f"{path}: breaks = {breaks!r}; allowed is a list of times in s")
    if not isinstance(limits, dict) or not all(_number(x) and x > 0 for x in limits.values()):
        raise InputError(f'{path}: limits = {limits!r}; allowed is {{ "tau.joint" = torque }}, above 0')
    for name in limits:
        if name not in names:
            raise InputError(f"{path}: limits has {name!r}; this model has {', '.join(names)}")
    return Cuts(tuple(sorted(map(float, breaks))), {name: float(x) for name, x in limits.items()})


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))
