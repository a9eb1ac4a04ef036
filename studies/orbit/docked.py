"""The numbers of what goes on from the soft capture to the latch."""

import numpy as np

from ...cosim.docked import (
    DockingRun,
    ball_shares,
    docked_of,
    energies,
    is_latched,
    mean_wrist,
    momentum_drift,
    preload,
    residual,
)
from ...models.docking.parameters import PRELOAD_WINDOW, DockingParameters
from ..outcome import Quantity
from .ledger import force_error, position_error
from .setting import OrbitCapture

__all__ = ["DockingRun", "docked_of", "energies", "is_latched", "mean_wrist", "measure", "momentum_drift"]

END = 10.0
"""Until then the ring moves as in the soft capture by itself [s]."""


def measure(d: DockingRun, p: DockingParameters, single: OrbitCapture, soft: float, spent: float) -> list[Quantity]:
    """The numbers of the whole end effector; ``single`` is the soft capture as one system, ``soft`` and ``spent`` are
    the processor times of both runs [s]."""
    latched, _ = is_latched(d, p)
    ends = [begin for state, begin, _ in d.whole.phases if state == "LATCHED"]
    radial, angle = residual(d)
    ledger = energies(d)
    return [
        Quantity("latched", "1", float(latched), "reference"),
        Quantity("time_to_latched", "s", ends[0] if ends else "never", "reference"),
        Quantity("peak_wrench_force", "N", float(mean_wrist(d)[1].max()), "reference"),
        Quantity("preload", "N", preload(d), "calibrated", None, *PRELOAD_WINDOW),
        Quantity("residual_radial", "m", radial, "reference"),
        Quantity("residual_angle", "rad", angle, "reference"),
        Quantity("least_share", "1", float(ball_shares(d, p, max(preload(d), 1.0)).min()), "reference"),
        Quantity("peak_cable_force", "N", float(d.tension.max()), "reference"),
        Quantity("peak_flank_force", "N", float(d.normal.max()), "reference"),
        Quantity(
            "latched.energy_residual", "1",
            float(np.abs(ledger["residual"]).max() / np.abs(ledger["motors"]).max()), "reference",
        ),
        Quantity("latched.momentum_drift", "1", momentum_drift(d), "reference"),
        Quantity("latched.error_to_monolithic", "m", position_error(d.capture, single, END), "reference"),
        Quantity(
            "latched.force_error_to_monolithic", "1", force_error(d.capture, single, END, 0.01), "reference"
        ),
        Quantity("latched.cost", "1", spent / soft, "reference"),
    ]  # fmt: skip
