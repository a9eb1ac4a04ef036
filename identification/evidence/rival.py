"""Another explanation of what a name explains."""

from dataclasses import dataclass

from ...models.model import PlacedEffect


@dataclass(frozen=True)
class RivalOdds:
    """A rival of an effect: its posterior share in the same place, and whether recordings can tell the two apart."""

    placed: PlacedEffect
    probability: float
    separable: bool
