"""The verdict of a diagnosis, made from what was decided and from nothing that is said of it."""

from collections.abc import Collection
from typing import Literal

Verdict = Literal["data_fault", "missing_physics", "unknown_effect", "adequate"]

_GRAVEST_FIRST: tuple[Verdict, ...] = ("data_fault", "missing_physics", "unknown_effect", "adequate")


def verdict(named: Collection[object], nameless: Collection[object], faults: Collection[object] = ()) -> Verdict:
    """What recordings say of a model.

    Parameters
    ----------
    named : collection
        Effects that the held-out recordings confirmed.
    nameless : collection
        What they confirmed of the remaining residual without an effect for it: curves, vibration, motion.
    faults : collection
        Contradictions between recordings and model that no physics explains: nothing is decided beside them.
    """
    if faults:
        return "data_fault"
    if named:
        return "missing_physics"
    return "unknown_effect" if nameless else "adequate"


def gravest(*verdicts: Verdict) -> Verdict:
    """The verdict on a model from the verdicts of several kinds of channels."""
    return min(verdicts, key=_GRAVEST_FIRST.index)
