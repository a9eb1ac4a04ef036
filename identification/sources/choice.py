"""Which names of a best set are fitted next, where a law's column says little of what the law does."""

from collections.abc import Sequence

import numpy as np

from ..decision.kind import Chosen
from ..decision.names import as_names
from ..evidence.search import MemberOdds, Search


def one_a_channel(made: Search, slots: Sequence[MemberOdds]) -> list[Chosen]:
    """Names to take, with what stands beside each: one at a time on every channel, for what is not in proportion to its
    size leaves a rest, which others would take up.

    The likeliest by itself is taken, where one by itself is likelier than none and no nameless curve is there; else the
    one that the best set gains most by.
    """
    if not slots:
        return []
    evidence, odds = made.on.evidence, made.scan([]).odds.copy()
    odds[[h for h, x in enumerate(made.pool) if h in made.barred or not x.named]] = -np.inf

    def reached(slot: MemberOdds) -> set[int]:
        return set(evidence.reached(evidence.items[slot.taken.item]))

    found, taken = [], set()
    for slot in sorted((s for s in slots if made.pool[s.taken.hypothesis].named), key=lambda s: -s.gain):
        reach = reached(slot)
        if reach & taken:
            continue
        taken |= reach
        own = [h for h, x in enumerate(made.pool) if reach & set(evidence.reached(x.items[0]))]
        h = max(own, key=lambda h: odds[h])
        curved = any(not made.pool[s.taken.hypothesis].named and reached(s) & reach for s in slots)
        if odds[h] > 0 and not curved:
            (single,) = as_names(made, [made.slot([made.take([], h)], 0)])
            found.append((single, [single]))
        else:
            found.append((slot, slots if curved else [slot]))
    return found
