"""How often a name was right at a given margin: a frequency counted on a bank of simulated arms, not a softmax.

``reliability.json`` beside this file holds the curve, and the command that made it.
"""

import json
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@cache
def _curve() -> tuple[Array, Array]:
    """Knots of margin, rising, and of probability, never falling; each (n_knots,)."""
    stored = json.loads(Path(__file__).with_name("reliability.json").read_text(encoding="utf-8"))
    return np.array(stored["margin"], float), np.array(stored["probability"], float)


def probability(margin: float) -> float:
    """Frequency with which an effect named at this margin was the right one, at the right place.

    Parameters
    ----------
    margin : float
        How often the effect beat its rivals in a bootstrap over time blocks, 0 to 1.

    Returns
    -------
    float
        Strictly between 0 and 1, and never less for a larger margin: linear between the knots, level beyond them. A
        name counts as right if the effect concealed in the simulation is the one named, or one that the recordings
        cannot tell from it.
    """
    knots, frequencies = _curve()
    return float(np.interp(margin, knots, frequencies))
