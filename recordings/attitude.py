"""A body's recorded attitude: its quaternion, one a sample, checked."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..errors import InputError
from .signals import QUATERNION

OFF = 0.1  # by how much a quaternion's length may miss 1: rounding stays far below, a wrong column far above


def attitude(data: xr.Dataset, body: str, path: object) -> NDArray[np.float64]:
    """``quat.<body>.w``, ``x``, ``y``, ``z`` (K, 4), w first; not a number where any of the four is missing.

    Raises
    ------
    InputError
        Where a quaternion's length is not 1.
    """
    turns = np.stack([np.asarray(data[f"quat.{body}.{axis}"].values, float) for axis in QUATERNION], 1)
    turns[~np.isfinite(turns).all(1)] = np.nan
    size = np.linalg.norm(turns, axis=1)
    if np.any(np.abs(size - 1) > OFF):
        worst = int(np.nanargmax(np.abs(size - 1)))
        raise InputError(
            f"{path}: quat.{body} at t = {data['time'].values[worst]:g} s has length {size[worst]:.3g}; "
            "give unit quaternions, w first"
        )
    return turns
