"""Where a recording starts: a spring, a tank or a sling may still ring (`nuisance.start`)."""

from collections.abc import Iterator

from ..hypotheses import starts
from ._block import FitContext, NuisanceBlock, of_every


def blocks(context: FitContext) -> Iterator[NuisanceBlock]:
    """Free responses of every law of the model that springs back."""
    found = context.found
    for k, p in enumerate(found.assembly.placed):
        made = starts(context.along, p, found.assembly.parameters(k, found.theta))
        if made:
            yield of_every(next(iter(made.values()))[0].shape[1], made)
