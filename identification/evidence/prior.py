"""Prior odds of named effects and nameless curves: shared by effects, by places, and by curves."""

from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from math import factorial

import numpy as np

from ...models.model import PlacedEffect
from ..deciding import ELSEWHERE, ODDS_OF_CURVES, ODDS_OF_NAMES
from ..search.candidates import shifts
from .pool import Curves, Hypothesis, Item


def pool(
    named: Mapping[str, tuple[PlacedEffect, list[Item]]],
    by_words: Curves,
    there: Sequence[PlacedEffect],
    coupled: Collection[str] = (),
) -> list[Hypothesis]:
    """Hypotheses with their prior odds: shared by the effects, and by the places of each (Scott and Berger 2010).

    An effect that is ``there`` in the model counts as one of its places. Joints that are ``coupled``, though no model
    says so, are as likely as an effect of its own."""

    def kind(p: PlacedEffect) -> str:
        return f"{p.effect.name} of coupled joints" if p.at in coupled else p.effect.name

    kinds = {key: kind(p) for key, (p, _) in named.items()}
    names = list(kinds.values())
    odds = ODDS_OF_NAMES / max(len(set(names)), 1)
    found = []
    for key, (p, items) in named.items():
        name = kinds[key]
        have = sum(kind(x) == name for x in there)
        n = have + names.count(name)
        # Joints are made alike; a sensor's fault, or a wrong mass, is an accident of one place.
        logs = [log_share_of_places(k, n) for k in range(1, n + 1)]
        steps = (float(np.log(odds)) + logs[0], *(b - a for a, b in pairwise(logs)))[have:]
        if p.effect.at != "joint":
            steps = (float(np.log(odds / n)),)
        apart = parts_of(p) | {k for k, (x, _) in named.items() if key in parts_of(x)}
        if joint := shifts(p):  # late or early: one of the two
            apart |= {k for k, (x, _) in named.items() if k != key and shifts(x) == joint}
        found.append(Hypothesis(key, True, tuple(items), steps[0], p, name, steps[1:], apart))
    each = float(np.log(ODDS_OF_CURVES / max(len(by_words), 1)))
    return found + [
        Hypothesis(f"curve.{c}.{words}", False, (item,), each, item.label) for (c, words), item in by_words.items()
    ]


def log_share_of_places(k: int, n: int) -> float:
    """Log probability that an effect which is there acts at k given places of its n.

    It acts at one place alone, each as likely; or at every place with a probability ρ of which nothing is known but
    that it is not zero: ∫ρ^k (1 - ρ)^(n-k) dρ = k! (n - k)! / (n + 1)!.
    """
    every = factorial(k) * factorial(n - k) / factorial(n + 1) * (n + 1) / n
    return float(np.log(ELSEWHERE * every + (1 - ELSEWHERE) * (k == 1) / n))


def parts_of(p: PlacedEffect) -> frozenset[str]:
    """Keys of the laws of which a whole law is another way to write the sum; none of any other law."""
    whole = p.effect.at == "joint" and len(p.effect.contains) > 1
    return frozenset(f"{x}.{p.at}" for x in p.effect.contains) if whole else frozenset()
