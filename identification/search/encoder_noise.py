"""What noise of the encoders leaves in the torque residual, through derivatives of the position and the model.

A spring or play between motor and link keeps the link from following fast motion. Where the fast motion is noise, the
torque with a spring is nearer the measured one although nothing is springy. A late torque sensor does the same.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..fitting.experiment import Experiment
from ..fitting.fit import Fit
from .rest import slow

Array = NDArray[np.float64]

UNEVEN = 1.5
"""Energy of encoder noise in the band over that of white noise as strong as what stands above the band: a coarse
encoder's steps follow its motion, and are not white."""


def encoder_torque(found: Fit, experiment: Experiment) -> Array:
    """Standard deviation (J,) of that torque in the analysis band, by the model's answer to a shaken motion."""
    motion = experiment.motion
    if "shaken" not in experiment.store:
        signs = np.random.default_rng(0).choice([-1.0, 1.0], (3, *motion.q.shape))
        shake = signs * motion.encoder_noise[:, None]
        moved = {n: np.asfortranarray(getattr(motion, n) + x) for n, x in zip(("q", "qd", "qdd"), shake, strict=True)}
        experiment.store["shaken"] = replace(experiment, motion=replace(motion, **moved), store={})
    shaken = experiment.store["shaken"]
    change = found.assembly.torque(shaken, found.theta) - found.assembly.torque(experiment, found.theta)
    # Near rest the sign of the speed would turn over, and nothing is judged there.
    return np.array([np.sqrt(np.mean(x[~slow(experiment, c)] ** 2)) for c, x in enumerate(change.T)])
