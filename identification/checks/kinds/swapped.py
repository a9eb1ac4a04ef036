"""Two channels exchanged: positions, torques, or both of two joints."""

from itertools import combinations

import numpy as np

from ..case import CheckCase
from ..finding import Kind
from ..reading import Reading


def readings(case: CheckCase) -> list[Reading]:
    """Every pair of joints of one kind: their positions, their torques, or both."""
    found = []
    for a, b in combinations(case.doubtful, 2):
        if case.tree.joints[a].kind != case.tree.joints[b].kind:
            continue
        order = np.arange(len(case.joints))
        order[[a, b]] = b, a
        for families, words in ((("tau",), "torques"), (("q",), "positions"), (("q", "tau"), "positions and torques")):
            names = [f"{family}.{case.joints[j]}" for family in families for j in (a, b)]
            others = [f"{family}.{case.joints[j]}" for family in families for j in (b, a)]
            made = case.reading(
                "swapped",
                names,
                f"the {words} of {case.joints[a]} and {case.joints[b]} are exchanged",
                [case.mends.taken_from(name, other) for name, other in zip(names, others, strict=True)],
            )
            sources = {"q": "source", "tau": "torque_source"}
            found.append(made.but(**{sources[family]: order for family in families}))
    return found


KIND = Kind("swapped", "two channels are exchanged", readings)
