"""Joints that hardly move: a recording shows only the torque that they hold."""

import numpy as np

from ..case import CheckCase
from ..finding import CheckFinding, Kind

TRAVEL = 30.0
"""A joint that moves less than this many times its encoder's noise says nothing of its friction or inertia."""


def find(case: CheckCase) -> list[CheckFinding]:
    """Joints that stand in every recording, and recordings in which none of them moves."""
    found = []
    for c, joint in enumerate(case.joints):
        seen = [_travel(dataset[f"q.{joint}"].to_numpy()) for dataset in case.datasets if f"q.{joint}" in dataset]
        if seen and all(travel < TRAVEL * noise or travel == 0 for travel, noise in seen):
            far = max(travel for travel, _ in seen)
            unit = "m" if case.tree.joints[c].kind == "prismatic" else "rad"
            found.append(
                CheckFinding(
                    "excitation",
                    joint,
                    0.99,
                    f"{joint} hardly moves: {far:.2g} {unit} in all, {TRAVEL:.0f} times its encoder's noise or less; "
                    "its friction, inertia and drive cannot be told",
                    f"locked = {{ {joint} = {float(np.nanmean(case.datasets[0][f'q.{joint}'].to_numpy())):.6g} }}",
                    fault=False,
                )
            )
    return found


def _travel(x: np.ndarray) -> tuple[float, float]:
    """How far a position goes, and its noise from sample to sample, steps of the encoder included."""
    x = x[np.isfinite(x)]
    if len(x) < 10:
        return 0.0, 0.0
    return float(np.ptp(x)), float(np.median(np.abs(np.diff(x, 2)))) / 1.65


KIND = Kind("excitation", "a joint hardly moves", find=find)
