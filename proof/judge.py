"""Judge one case: what a method said of it against its answer.

A name is right if the effect is named, or is among those that the method says the recordings cannot tell from the one
it names (one class). A case is right if every effect concealed in it is named and no other. Its place is right if the
joint is (joint2, link2 and tau.joint2 are one), for every effect named.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from snarelab.models.effects import effects

from .cases import BANDS, Answer, Truth
from .concealed import STRUCTURE, VALUES
from .oracle import over_floor

Diagnosed = Mapping[str, Any]
AUDIBLE = 1.02
"""An error below this multiple of its oracle's leaves nothing to close."""

MASSES, ROTORS = ("payload_mass", "inertia_error"), ("rotor_inertia",)
"""Names that say that a link's mass, and a joint's rotor, are not what the model says."""

SILENT = "none"
"""Verdict of a method that names nothing, by what it is: it has no false alarms, and no right names."""


@dataclass(frozen=True)
class Scored:
    """One case.

    ``claims``: (probability, right) of each class named. ``error``: error on the third recording over its floor where
    the concealed effects show, (before, after); ``oracle``: there, too, what that arm leaves with nothing concealed.
    ``moved``: of each number of the body that is right (a mass a link, a rotor a joint), whether it is said to be
    wrong. ``deviations``: of the values of right names, (told - true) / std.
    """

    answer: Answer
    verdict: str
    named: tuple[tuple[str, str], ...]
    first: bool
    name: bool
    place: bool
    blamed: bool
    claims: tuple[tuple[float, bool], ...]
    sizes: tuple[int, ...]
    error: tuple[float, float] | None
    oracle: float = 1.0
    moved: tuple[bool, ...] = ()
    deviations: tuple[float, ...] = ()

    @property
    def closure(self) -> float | None:
        """(before − after) / (before − oracle), third recording; where there was nothing to close, 1 if that stayed."""
        return self._closed(self.oracle)

    @property
    def closure_to_floor(self) -> float | None:
        """This case with an oracle's floor, which is disturbance and noise alone."""
        return self._closed(1.0)

    def _closed(self, least: float) -> float | None:
        if self.error is None:
            return None
        before, after = self.error
        if before < AUDIBLE * least:
            return float(after < AUDIBLE * least)
        return (before - after) / (before - least)


def judge(answer: Answer, found: Diagnosed, oracle: Mapping[str, float] | None = None) -> Scored:
    """Score one case; ``oracle``: error over its floor of every channel, in the band of what was found."""
    classes = [_class(e) for e in names_in(found)]
    right = [_fits(c, answer.truths) for c in classes]
    placed = rightly_placed(answer, found)
    probability = [
        min(e["probability"] + sum(r["probability"] for r in e["rivals"] if not r["separable"]), 1.0)
        for e in names_in(found)
    ]
    whole = bool(answer.truths) and all(_found(t, classes) for t in answer.truths)
    return Scored(
        answer,
        found["verdict"],
        tuple((e["name"], e["at"]) for e in names_in(found)),
        first=bool(right) and right[0],
        name=whole and all(right),
        place=bool(answer.truths) and all(_found(t, classes, at=True) for t in answer.truths) and all(placed),
        blamed=any(all(is_physics(name) for name, _ in c) for c in classes),
        claims=tuple(zip(probability, placed, strict=True)),
        sizes=tuple(len(c) for c in classes),
        error=_error(answer, found),
        oracle=over_floor(oracle or {}, answer.channels),
        moved=_moved(answer, classes),
        deviations=_deviations(answer, found),
    )


def rightly_placed(answer: Answer, found: Diagnosed) -> list[bool]:
    """Of every effect named, whether its class holds one that is concealed, at its place."""
    return [_fits(_class(e), answer.truths, at=True) for e in names_in(found)]


def names_in(found: Diagnosed) -> list[Mapping[str, Any]]:
    """Effects that name something; a table that stands for what has no name says nothing of what it is."""
    return [e for e in found["effects"] if e["name"] != "empirical"]


def _class(effect: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The name given, and those that the method cannot tell from it."""
    return [(effect["name"], effect["at"]), *((r["name"], r["at"]) for r in effect["rivals"] if not r["separable"])]


def _fits(some: Sequence[tuple[str, str]], truths: Sequence[Truth], at: bool = False) -> bool:
    return any(n in (t.name, *t.also) and (not at or joint(place) == joint(t.at)) for n, place in some for t in truths)


def _found(truth: Truth, classes: Sequence[Sequence[tuple[str, str]]], at: bool = False) -> bool:
    """Whether a truth is named, or two of the effects that hide with it are."""
    named = [{n for n, place in c if not at or joint(place) == joint(truth.at)} for c in classes]
    parts = [n for n in truth.also if any(n in c for c in named)]
    return any(truth.name in c for c in named) or (len(parts) > 1 and sum(bool(c & set(parts)) for c in named) > 1)


def _deviations(answer: Answer, found: Diagnosed) -> tuple[float, ...]:
    """Of what was concealed and named at its place, where the value has a standard deviation and is at no bound."""
    told = []
    for truth, value in zip(answer.truths, answer.value, strict=False):
        for e in names_in(found):
            if (e["name"], joint(e["at"])) == (truth.name, joint(truth.at)):
                own = e.get("parameters", {}).get(VALUES.get(truth.name, ""))
                if own and own["std"] and not own.get("at_bound", False):
                    told.append((abs(own["value"]) - abs(value)) / own["std"])
    return tuple(told)


def _moved(answer: Answer, classes: Sequence[Sequence[tuple[str, str]]]) -> tuple[bool, ...]:
    """None where a number of the body is what is wrong, or at the joints where something is concealed."""
    if answer.group == "wrong":
        return ()
    joints = set(range(1, answer.joints + 1)) - {joint(t.at) for t in answer.truths}
    found = []
    for names in MASSES, ROTORS:
        said = {joint(c[0][1]) for c in classes if all(name in names for name, _ in c)}
        found += [k in said for k in sorted(joints)]
    return tuple(found)


def is_physics(name: str) -> bool:
    """Whether a name is more than a wrong parameter or a faulty sensor."""
    return effects()[name].family != "measurement" and name not in STRUCTURE


def joint(place: str) -> int:
    """Number of the joint that a place belongs to."""
    return int(re.findall(r"\d+", place)[-1])


def _error(answer: Answer, found: Diagnosed) -> tuple[float, float] | None:
    """RMS on the third recording before and after over its floor, where what is concealed shows most."""
    if not found["third"] or not answer.channels:
        return None
    pairs = []
    for channel in answer.channels:
        lowest = float(np.interp(found["band"]["value"], BANDS, answer.floor[channel]))
        before, after = found["third"][channel]
        pairs.append((before / lowest, after / lowest))
    before, after = np.sqrt(np.mean(np.square(pairs), axis=0))
    return float(before), float(after)
