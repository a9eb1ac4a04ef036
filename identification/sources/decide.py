"""The whole decision: search, confirm, search again in place of names that were not confirmed, and nameless curves."""

from collections.abc import Callable
from dataclasses import dataclass

from ..deciding import SECOND_CHOICES
from ..evidence.selection import Remainder
from ..verdict import Verdict, verdict
from .confirm import Confirmation, confirm, remainders
from .fit import residuals
from .search import Naming, Selection, search
from .source import Linearisation, ModelPoint, Source


@dataclass(frozen=True)
class Decision:
    """The decision: the search, the confirmed and the rejected names, nameless curves, and the held-out recordings
    under the model as given.
    """

    given: ModelPoint
    found: Selection
    best: Confirmation
    rejected: tuple[Naming, ...]
    left: tuple[Remainder, ...]
    before: Linearisation

    @property
    def verdict(self) -> Verdict:
        """The verdict by the names and the nameless curves."""
        return verdict(self.best.names, self.left)


def decide(source: Source, given: ModelPoint, progress: Callable[[str], None] = lambda _: None) -> Decision:
    """Name what a model leaves out of some recordings."""
    found = search(source, given, progress=progress)
    best = last = confirm(source, given, found, progress)
    rejected = {n.placed.key: n for n in last.rejected}
    for _ in range(SECOND_CHOICES):
        if not last.rejected:
            break
        progress("searching another explanation for what the held-out recordings did not confirm")
        again = search(source, given, barred=rejected, progress=progress)
        last = confirm(source, given, again, progress)
        rejected |= {n.placed.key: n for n in last.rejected}
        if last.density > best.density:
            found, best = again, last
    left = remainders(source, given, best, rejected)
    at = source.settled(found.first.at, source.held)
    before = Linearisation(at, residuals(source, source.held, at), ())
    return Decision(given, found, best, tuple(rejected.values()), left, before)
