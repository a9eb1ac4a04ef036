"""Which cases there are: groups, what each conceals, and how its disturbance runs in time."""

from dataclasses import dataclass

import numpy as np

from ..cases import SKEWED, WRONG
from ..concealed import MAKERS
from ..drives.cases import CLEAN, FAULTY, LAWLESS, PAIR, SINGLE, SIZES, dealt, endless
from ..drives.motions import KINDS, WHITE
from ..outside import OUTSIDE
from .faults import FAULTS

GROUPS = (CLEAN, SINGLE, PAIR, LAWLESS, "wrong", "sensor", FAULTY)
DECK = (*[CLEAN] * 16, *[SINGLE] * 13, *[PAIR] * 11, *[LAWLESS] * 4, *["wrong"] * 2, "sensor", *[FAULTY] * 3)
"""Fifty cases. A third of those with something in them have two to four effects."""

SPRINGS = ("joint_elasticity", "backlash")
"""Of these a case has one at most."""


@dataclass(frozen=True)
class Plan:
    """A case before it is drawn: its group, (what, size) of what it conceals, and the kind of its disturbance."""

    group: str
    concealed: tuple[tuple[str, float], ...]
    disturbance: str = WHITE


def planned(seed: int, count: int) -> list[Plan]:
    """The first ``count`` cases of a seed, the same however many follow."""
    items = {
        SINGLE: [(name, size) for name in MAKERS for size in SIZES],
        LAWLESS: [(name, size) for name in OUTSIDE for size in (2.0, 4.0)],
        "wrong": [(what, 2.0) for what in WRONG],
        "sensor": [(what, 2.0) for what in SKEWED],
        FAULTY: [(what, 0.0) for what in FAULTS],
    }
    ones = {group: endless(seed, 1 + k, some) for k, (group, some) in enumerate(items.items())}
    kinds = {group: endless(seed, 11 + k, KINDS) for k, group in enumerate(GROUPS)}
    several = np.random.default_rng([seed, 0, 9])
    plans = []
    for group in dealt(seed, DECK, count):
        one = ones.get(group)
        concealed = _several(several) if group == PAIR else (next(one),) if one else ()
        plans.append(Plan(group, concealed, next(kinds[group])))
    return plans


def _several(rng: np.random.Generator) -> tuple[tuple[str, float], ...]:
    """Two to four effects of one size."""
    size = float(rng.choice((1.0, 2.0, 4.0)))
    count = int(rng.integers(2, 5))
    while True:
        names = rng.choice(list(MAKERS), count, replace=False).tolist()
        if len(set(names) & set(SPRINGS)) < 2:
            return tuple((name, size) for name in names)
