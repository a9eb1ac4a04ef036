"""How often a name was right: frequencies counted on simulated arms with known answers, not a softmax.

``reliability.json`` beside this file holds what was counted, by which command: a logistic map.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

LEAST = 1e-3
"""What stands for any smaller held-out gain or share."""


@cache
def _stored() -> dict[str, Any]:
    return json.loads(Path(__file__).with_name("reliability.json").read_text(encoding="utf-8"))


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
