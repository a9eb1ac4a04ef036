"""Which names of a best set are fitted next, where torques are linear in most of them."""

from collections.abc import Sequence

from ..deciding import LAW_ERROR
from ..decision.kind import Chosen
from ..evidence.search import MemberOdds, Search
from .laws import remembers


def together(made: Search, slots: Sequence[MemberOdds], large: Sequence[MemberOdds]) -> list[Chosen]:
    """The ``large`` names that add more than the error of the laws that are not fitted yet; else all of them.

    What adds less waits until these are. What rings or lags explains little before its frequency is fitted: nothing is
    judged beside it.
    """
    named = [s for s in large if made.pool[s.taken.hypothesis].named]
    if not named:
        return []
    least = LAW_ERROR**2 * made.members([s.taken for s in slots]).value
    news = [s for s in named if s.gain >= least] or named
    alone = made.scan([]).odds
    leading = max(news, key=lambda s: alone[s.taken.hypothesis])
    if remembers(made.pool[leading.taken.hypothesis].label):
        news = [leading]
    return [(s, slots) for s in news]
