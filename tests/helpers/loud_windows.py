"""What is left of a channel, half a second at a time."""

import numpy as np

from snarelab.identification.nuisance.bursts import ChannelResidual

STEP, LENGTH = 0.01, 50
"""Half a second at 100 Hz."""


def windows(*energies, residual=None, step=STEP) -> ChannelResidual:
    """Windows of a constant strength each; a vibration of 8 Hz by default."""
    energy = np.repeat(np.array(energies, float), round(0.5 / step))
    wave = np.sqrt(2 * energy) * np.sin(2 * np.pi * 8 * step * np.arange(len(energy)))
    return ChannelResidual(wave if residual is None else residual, energy, np.ones(len(energy), bool), step)
