"""Samples near rest along a motion whose speed is given."""

from typing import Any

import numpy as np
from moving_arm import exact

from snarelab.identification.nuisance.rest import share

PERIOD, PEAK = 0.01, 2.0


def motion(speed, segments=None, noise=0.0) -> Any:
    """Every sample is one of the analysis band: nothing is thinned or filtered."""
    qd = np.asarray(speed, float)[:, None]
    t = PERIOD * np.arange(len(qd))
    made = exact(("joint1",), PERIOD, 1, (t, np.cumsum(qd, axis=0) * PERIOD, qd, 0 * qd, 0 * qd), segments)
    made.encoder_noise[1] = noise
    return made


def near_rest(speed, zone, travel=1.0, **given):
    return np.flatnonzero(share(motion(speed, **given), np.ones(1), zone, PEAK, travel)).tolist()
