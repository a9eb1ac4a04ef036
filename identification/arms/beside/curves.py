"""What any model has wrong: small curves of every channel, larger ones over what its laws run over (Kennedy, O'Hagan
2001); and the nameless curves that a search ended with.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ...deciding import DISCREPANCY, LAW_ERROR
from ...evidence.weighed import Part
from ...fitting.fit import Fit
from ...nuisance.curve import SMALL
from ..laws import coordinate, shapes
from ._block import FitContext, NuisanceBlock

Array = NDArray[np.float64]


def blocks(context: FitContext) -> Iterator[NuisanceBlock]:
    """A block a curve."""
    sizes = _sizes(context.found, context.train, context.along.scale)
    for (c, words), item in context.by_words.items():
        size = float(np.hypot(sizes.get((c, words), 0.0), context.nameless.get((c, words), 0.0)))
        if size > 0:
            at = np.arange(len(item.index))
            some = [context.columns.some(i, c, item.index) for i in range(len(context.along.instruments))]
            yield NuisanceBlock(len(at), [{c: (at, x * (size * item.spread))} for x in some])


def _sizes(found: Fit, baseline: Sequence[Sequence[Part]], scale: Array) -> dict[tuple[int, str], float]:
    """Sizes of the small curves beside every explanation, by channel and words [RMS torque of the channel].

    No law of the model is exact: a curve over what it runs over is a share of what the law does there.
    """
    sizes = {(c, words): DISCREPANCY**2 for c in range(len(scale)) for words in SMALL}
    assembly, shape = found.assembly, shapes(found.assembly)
    for p in assembly.placed:
        words = coordinate(p.effect)
        own = [int(i) for i in assembly.index_of(p) if not shape[i]]
        if words is None or p.effect.at != "joint" or not own:
            continue
        c = assembly.joint_of(p)
        index = baseline[0][c][0]
        at = [int(np.flatnonzero(index == i)[0]) for i in own if i in index]
        torque = np.concatenate([row[c][1][:, at] @ found.theta[index[at]] for row in baseline])
        share = float(np.sqrt(np.mean(torque**2))) / scale[c]
        sizes[c, words] = sizes.get((c, words), 0.0) + (LAW_ERROR * share) ** 2
    return {key: float(np.sqrt(v)) for key, v in sizes.items()}
