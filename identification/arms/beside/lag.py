"""What laws with a memory have wrong: they are early or late, and `BENDS` of them is."""

from collections.abc import Iterator

import numpy as np

from ...deciding import BENDS
from ...search.refit import carry
from ..hypotheses import lagging
from ..laws import remembers
from ._block import FitContext, NuisanceBlock, of_every


def blocks(context: FitContext) -> Iterator[NuisanceBlock]:
    """The first two derivatives by time of what each such law of the model does."""
    along, found = context.along, context.found
    assembly, n_channels = found.assembly, len(along.scale)
    for p in assembly.placed:
        if not remembers(p):
            continue
        rest = assembly.keep([x for x in assembly.placed if x.key != p.key], found.theta)
        left = carry(found, rest)
        made = [e.motion.to_band(assembly.torque(e, found.theta) - rest.torque(e, left)) for e in along.instruments]
        item = lagging(along, {c: [x[:, [c]] for x in made] for c in range(n_channels)}, context.columns)
        rms = np.sqrt(np.mean(np.concatenate(made[: along.n_train]) ** 2, axis=0))
        size = BENDS[0] * float(np.max(rms / along.scale)) * item.spread
        own = {c: [context.columns.some(i, c, item.index) * size for i in range(len(made))] for c in range(n_channels)}
        yield of_every(2, own)
