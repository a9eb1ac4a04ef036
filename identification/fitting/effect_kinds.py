"""Which kind of place an effect acts at."""

from ...models.model import PlacedEffect
from ...models.tree import Tree
from .beam_place import BeamPlace
from .effect_places import BasePlace, EffectPlace, EncoderPlace, JointPlace, LinkPlace, SensorPlace
from .rig_places import BoomPlace, SlidePlace, SlingPlace, SuspensionPlace

KINDS: dict[str, type[EffectPlace]] = {
    "joint": JointPlace,
    "link": LinkPlace,
    "sensor": SensorPlace,
    "sling": SlingPlace,
    "slide": SlidePlace,
    "boom": BoomPlace,
    "suspension": SuspensionPlace,
    "beam": BeamPlace,
    "base": BasePlace,
}
"""By what effects name in ``at``."""


def effect_place(tree: Tree, placed: PlacedEffect, joint: int, speed_scale: float, early_alone: bool) -> EffectPlace:
    """The place of an effect; arguments as of `EffectPlace`.

    ``early_alone``: a late encoder makes its own torque channel early, and no other."""
    encoder = placed.at.startswith("q.") and not early_alone
    return (EncoderPlace if encoder else KINDS[placed.effect.at])(tree, placed, joint, speed_scale)
