"""Encoder noise that reaches a joint's torque through the arm's inertia: M(q) times the noise of the acceleration.

White noise of an encoder, its steps included, has a spectrum that grows with f⁴ once it is differentiated twice. In
the analysis band it is close to the second difference of white noise, as strong as the conditioning says it is.
"""

import numpy as np
from numpy.typing import NDArray

from ..fitting.experiment import Experiment

Array = NDArray[np.float64]


def encoder_noise(experiment: Experiment, channel: int) -> Array:
    """Standard deviation of the encoders' noise in a torque channel, in the analysis band (n_band,) [N·m or N]."""
    motion = experiment.motion
    torque = experiment.mass_matrix[:, channel, :] * motion.encoder_noise[2]
    return np.sqrt(np.maximum(motion.to_band(np.sum(torque**2, axis=1)), 0.0))
