"""A capture in one Exudyn system, read as the co-simulated one is."""

import numpy as np

from ...models.floating.space_arm import CAPTURE_POSE, ROTOR_INERTIA
from ...models.inertia import Array
from ...models.monolithic.capture import MonolithicCapture
from ...models.snare.parameters import SnareParameters
from .setting import DURATION, JointResistance, OrbitCapture, Setting


def reference(
    start: Setting,
    passive: JointResistance,
    snare: SnareParameters,
    duration: float = DURATION,
    every: float = 0.01,
    step: float = 1e-3,
) -> tuple[OrbitCapture, Array]:
    """The monolithic capture (no angular impulse: NaN), and the total momentum (n, 6) about the tip's start.

    Recorded ``every`` and stepped by at most ``step`` [s]; joints without springs.
    """
    model = MonolithicCapture(start.arm, CAPTURE_POSE, snare, start.target, passive.friction, ROTOR_INERTIA)
    h = model.run(duration, every, step)
    unknown = np.full_like(h.impulse, np.nan)
    return OrbitCapture(h.times, h.tip, h.pin, h.base, h.q, h.qd, h.impulse, unknown, h.first_contact), h.momentum
