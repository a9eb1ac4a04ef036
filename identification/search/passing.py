"""Which candidates pass: beyond noise, better on time blocks left out, and worth a name; best first."""

from collections.abc import Sequence

from .closed_loop import DRIVEN
from .encoder_noise import UNEVEN
from .judged import Judged
from .screening import Screening, reliably_positive
from .trial import WORTH

ALIKE = 0.98
"""Cosine from which on two effects explain the same."""

TIE = 2.0
"""Difference of two scores that says nothing (Kass and Raftery 1995: not worth more than a bare mention)."""


def all_passing(result: Screening, joints: Sequence[str]) -> list[Judged]:
    """Candidates that pass every test, best first; what acts at a joint finds its channel among ``joints``."""
    passing = [j for j in result.judged if _passes(result, j)]
    for j in [j for j in passing if seen_near_rest(result, j)]:
        # Scores on different samples do not compare: those that beat it on its own go first.
        others = [o for o in passing if o is not j and set(o.channels) == set(j.channels)]
        better = [o for o in others if _same_samples(result, j, o).score > j.score]
        passing.remove(j)
        passing.insert(max((passing.index(o) + 1 for o in better), default=0), j)
    # What disturbances could have driven, if nothing else, is named where nothing else is.
    driven = [j for j in passing if _as_measured(result, j)]
    first = [j for j in passing if j not in driven]
    alone = [j for j in driven if not any(joints.index(j.placed.at) in o.channels for o in first)]
    return _untied(result, [*first, *alone])


def _passes(result: Screening, j: Judged) -> bool:
    """Does a candidate pass every test?"""
    # What a disturbance drives is let into the motion up to a share, and looks like a late sensor.
    late = j.placed.effect.at == "sensor" and bool(j.placed.effect.states)
    worth = max(result.worth[j.placed.key], DRIVEN if late else 0.0)
    if late and j.placed.at.startswith("tau."):
        # A torque that comes late follows the noise of the motion least, and is nearer to the measured one for that.
        worth = max(worth, WORTH + UNEVEN * float(result.heard[j.channels[0]]))
    if j.score <= result.threshold[j.channels] or j.explained < worth:
        return False
    return reliably_positive(j.case.fresh_gains())


def _as_measured(result: Screening, j: Judged) -> bool:
    """Does a drive's spring or play pass along the motion as measured, and not along what was asked for?"""
    if j.case.evidence is not result.measured.evidence or j.placed.effect.acts_on != "position":
        return False
    asked = result.asked.get(j.placed.key)
    return asked is None or not _passes(result, asked)


def _untied(result: Screening, passing: list[Judged]) -> list[Judged]:
    """Twins, which explain the same in motion and as well, in the order of what they explain near rest, too.

    That is weak evidence, since a joint that sticks may hold anything; it only orders what nothing else does. Where it
    says nothing either, a faulty sensor comes first: it is the first to be ruled out on a rig.
    """
    for k in range(len(passing)):
        j = passing[k]
        if seen_near_rest(result, j):
            continue
        twins = [
            o
            for o in passing[k + 1 :]
            if o.channels == j.channels
            and not seen_near_rest(result, o)
            and j.score - o.score < TIE
            and result.evidence.likeness(j.signal(), o.signal()) > ALIKE
        ]
        if twins:
            alike = {id(o): o.among(result.near_rest).score for o in (j, *twins)}
            likely = [o for o in (j, *twins) if alike[id(o)] > max(alike.values()) - TIE]
            best = max(likely, key=lambda o: (o.placed.effect.family == "measurement", alike[id(o)]))
            passing.remove(best)
            passing.insert(k, best)
    return passing


def _same_samples(result: Screening, j: Judged, other: Judged) -> Judged:
    """The other candidate on the samples that the first was judged on."""
    return other if seen_near_rest(result, other) or not seen_near_rest(result, j) else other.among(result.near_rest)


def seen_near_rest(result: Screening, j: Judged) -> bool:
    """Was it judged on samples near rest, too?"""
    return j.case.evidence is result.near_rest.evidence
