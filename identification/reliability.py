"""How often a name was right: frequencies counted on simulated arms with known answers, not a softmax.

``reliability.json`` beside this file holds what was counted, by which command: a logistic map for names of torques, and
a curve over the margin for those of link encoders and captures.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


LEAST = 1e-3
"""What stands for any smaller held-out gain or share."""

BOOTSTRAPS = 400
"""Resamplings of time blocks that a margin is counted over."""


@cache
def _stored() -> dict[str, Any]:
    return json.loads(Path(__file__).with_name("reliability.json").read_text(encoding="utf-8"))


@cache
def _curve() -> tuple[Array, Array]:
    """Knots of margin, rising, and of probability, never falling; each (n_knots,)."""
    stored = _stored()
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


def of_name(gain: float, sure: float, explained: float) -> float:
    """Frequency with which a name with this evidence was the right one, at the right place.

    A logistic regression on log(1 + gain), log(sure) and the log odds of the share explained, counted as
    ``reliability.json`` says. A name that stands in for another law leaves most of it over.

    Parameters
    ----------
    gain : float
        Log Bayes factor on the training recordings.
    sure : float
        What the held-out recordings gain by it [standard errors over blocks of time].
    explained : float
        Share of the held-out residual's energy that goes with it, 0 to 1.
    """
    level, by_gain, by_held, by_share = _stored()["logit"]
    share = min(max(explained, LEAST), 1 - LEAST)
    x = level + by_gain * np.log1p(max(gain, 0.0)) + by_held * np.log(max(sure, LEAST))
    x += by_share * np.log(share / (1 - share))
    return float(1 / (1 + np.exp(-x)))
