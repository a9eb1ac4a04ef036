"""What a law of a force that several channels feel has wrong: friction of slides, of booms and of the base.

A curve over the speed of the joint that it goes with, on a logarithmic scale: most of it is near rest.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ....models.model import PlacedEffect
from ...deciding import LAW_ERROR
from ...fitting.fit import Fit
from ...nuisance.curve import over_decades
from ...search.refit import carry
from ..hypotheses import ColumnSource
from ..laws import coordinate
from ._block import FitContext, NuisanceBlock

Array = NDArray[np.float64]


def blocks(context: FitContext) -> Iterator[NuisanceBlock]:
    """A block a law."""
    for p in context.found.assembly.placed:
        if p.effect.at != "joint" and coordinate(p.effect) is not None:
            made = error_of_force(context.along, context.found, p)
            k = made[0][0][1].shape[1]
            yield NuisanceBlock(k, [{c: (np.arange(k), x) for c, x in own} for own in made])


def error_of_force(along: ColumnSource, found: Fit, p: PlacedEffect) -> list[list[tuple[int, Array]]]:
    """What friction that several channels feel has wrong, as a curve over the speed of the joint that it goes with, on
    a logarithmic scale: most of it is near rest. Of each recording, channels and columns (n, k) in units of their prior
    deviation, `LAW_ERROR` of the friction."""
    assembly, n, c = found.assembly, along.n_train, found.assembly.joint_of(p)
    place, made = assembly.at(p), []
    for e, x in zip(along.instruments, along.coordinates(c), strict=True):
        own = over_decades(x)
        terms = place.spread(e, np.zeros((len(own), 1)), own[:, None, :])
        made.append([(at, e.to_band(columns, at)) for at, _, columns in terms])
    rest = assembly.keep([x for x in assembly.placed if x.key != p.key], found.theta)
    left = carry(found, rest)
    law = [
        e.motion.to_band(assembly.torque(e, found.theta) - rest.torque(e, left))[:, c] for e in along.instruments[:n]
    ]
    unit = [x for row in made[:n] for at, x in row if at == c]
    size = np.sqrt(np.mean(np.concatenate(law) ** 2) / np.mean(np.sum(np.concatenate(unit) ** 2, axis=1)))
    return [[(at, LAW_ERROR * size * x) for at, x in row] for row in made]
