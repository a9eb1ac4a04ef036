"""Opening the sealed answer: was the concealed effect named, at its place, and does its removal of error hold?"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...identification.diagnosis import Diagnosis
from .friction import SlideFrictionCurve
from .slide import Slide

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """How a diagnosis did.

    Parameters
    ----------
    named : bool
        The concealed effect is among the effects found; for nothing concealed, the verdict is ``adequate``.
    placed : bool
        ... at its own place.
    in_class : bool
        It is named, or is a rival that the diagnosis says it cannot tell from one it named.
    wrong : int
        Effects found that are not concealed, or not at that place; what is concealed beside the effect is right.
    coverage : float
        Share of the true friction curves inside the 2σ bands.
    """

    named: bool
    placed: bool
    in_class: bool
    wrong: int
    coverage: float


def score(answer: Mapping[str, Any], diagnosis: Diagnosis, drawn: Sequence[SlideFrictionCurve]) -> Score:
    """Compare a diagnosis and the friction curves with the plant's answer.

    Parameters
    ----------
    answer : mapping
        From `recordings.open_answer`.
    diagnosis : Diagnosis
    drawn : sequence of SlideFrictionCurve
    """
    effect = answer["effect"]
    covered = coverage(drawn, true_curves(answer, drawn))
    if effect is None:
        quiet = diagnosis.verdict == "adequate"
        return Score(quiet, quiet, quiet, len(diagnosis.effects), covered)
    found = {(e.name, e.at) for e in diagnosis.effects}
    rivals = {(r.name, r.at) for e in diagnosis.effects for r in e.rivals if not r.separable}
    names = {name for name, _ in found}
    true = {(e["name"], e["at"]) for e in (effect, answer.get("beside")) if e}
    return Score(
        effect["name"] in names,
        (effect["name"], effect["at"]) in found,
        effect["name"] in names | {name for name, _ in rivals},
        len(found - true),
        covered,
    )


def true_curves(answer: Mapping[str, Any], drawn: Sequence[SlideFrictionCurve]) -> dict[str, Array]:
    """The plant's steady friction force at one contact over each curve's speeds [N]."""
    found = {}
    for c in drawn:
        law = dict(answer["friction"][c.joint])
        radius = law.pop("radius")
        found[c.joint] = Slide(**law).steady(radius * c.speed)
    return found


def coverage(drawn: Sequence[SlideFrictionCurve], truth: Mapping[str, Array]) -> float:
    """Share of all points of all curves that lie inside the 2σ band."""
    inside = np.concatenate([np.abs(truth[c.joint] - c.force) <= 2 * c.std for c in drawn])
    return float(np.mean(inside))
