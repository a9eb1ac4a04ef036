"""Which rejected names the next search leaves out."""

from collections.abc import Mapping, Sequence
from typing import Protocol, TypeVar

from ...models.model import PlacedEffect


class _Name(Protocol):
    @property
    def placed(self) -> PlacedEffect: ...


class _Loss(Protocol):
    @property
    def gain(self) -> float: ...


Name = TypeVar("Name", bound=_Name)


def barred(rejected: Sequence[Name], lost: Mapping[str, _Loss]) -> dict[str, Name]:
    """Of the rejected names those that the held-out recordings contradict: they predict better without them. If there
    are none, all of them.

    What was weighed beside a name that is not there gets another turn without it.

    Parameters
    ----------
    rejected : sequence
        Names of a search.
    lost : mapping of str to loss
        By key, what the held-out recordings lose without each.
    """
    against = [n for n in rejected if lost[n.placed.key].gain < 0]
    return {n.placed.key: n for n in against or rejected}
