"""The whole decision: search, confirm, search again in place of names that were not confirmed, and what has no name."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic

from ..deciding import SECOND_CHOICES
from ..verdict import Verdict, verdict
from .confirm import Confirmation, confirm
from .kind import RecordingKind
from .nameless import NamelessParts, left_over
from .search import search
from .selection import F, Naming, Selection


@dataclass(frozen=True)
class Decision(Generic[F]):
    """Names that the held-out recordings confirmed, what has no name, and the names that were rejected."""

    best: Confirmation[F]
    left: NamelessParts
    rejected: tuple[Naming, ...]

    @property
    def found(self) -> Selection[F]:
        """The search whose names were confirmed best."""
        return self.best.found

    @property
    def verdict(self) -> Verdict:
        """The verdict by the names, and by what has none."""
        return verdict(self.best.names, self.left.told)


def decide(kind: RecordingKind[F], progress: Callable[[str], None] = lambda _: None) -> Decision[F]:
    """Name what a model leaves out of some recordings."""
    found = search(kind, progress=progress)
    best = last = confirm(kind, found, progress)
    rejected = {n.placed.key: n for n in last.rejected}
    for _ in range(SECOND_CHOICES):
        if not last.rejected:
            break
        progress("searching another explanation for what the held-out recordings did not confirm")
        again = search(kind, before=last.found, barred=rejected, progress=progress)
        last = confirm(kind, again, progress)
        rejected |= {n.placed.key: n for n in last.rejected}
        if last.forecast.density > best.forecast.density:
            best = last
    return Decision(best, left_over(kind, best, rejected), tuple(rejected.values()))
