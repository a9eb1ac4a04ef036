"""Identified parameters as the published list: what a capture's and a docking's fits have in common."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..models.model import PlacedEffect
from .diagnosis import Estimate


def parameter_list(placed: Sequence[PlacedEffect], made: Mapping[str, Mapping[str, Estimate]]) -> list[dict[str, Any]]:
    """Every parameter of the effects, in order, with its deviation; null where the recordings do not carry it.

    Parameters
    ----------
    placed : sequence of PlacedEffect
    made : mapping
        Estimates by the effects' keys, then by parameter.
    """
    return [
        {
            "effect": effect.effect.name,
            "at": effect.at,
            "name": name,
            "value": estimate.value,
            "std": estimate.std if np.isfinite(estimate.std) else None,
            "unit": estimate.unit,
            "at_bound": estimate.at_bound,
            "identifiable": bool(np.isfinite(estimate.std)),
        }
        for effect in placed
        for name, estimate in made[effect.key].items()
    ]
