"""What noise of the encoders leaves in the torque residual, through the second derivative and the model's inertia.

A spring or play between motor and link keeps the link from following fast motion. Where the fast motion is noise, the
torque with a spring is nearer the measured one although nothing is springy.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..fitting.experiment import Experiment
from ..fitting.fit import Fit

Array = NDArray[np.float64]


def encoder_torque(found: Fit, experiment: Experiment) -> Array:
    """Standard deviation (J,) of that torque in the analysis band, by the model's answer to a shaken acceleration."""
    motion = experiment.motion
    if "shaken" not in experiment.store:
        signs = np.random.default_rng(0).choice([-1.0, 1.0], motion.qdd.shape)
        shaken = replace(motion, qdd=np.asfortranarray(motion.qdd + signs * motion.encoder_noise))
        experiment.store["shaken"] = replace(experiment, motion=shaken, store={})
    change = found.assembly.torque(experiment.store["shaken"], found.theta) - found.assembly.torque(
        experiment, found.theta
    )
    return np.sqrt(np.mean(change**2, axis=0))
