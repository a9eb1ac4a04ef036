"""Why a case was not right, as far as its own answer shows it."""

from collections.abc import Mapping
from typing import Any

from .cases import Answer
from .judge import Scored, joint, names_in

Diagnosed = Mapping[str, Any]


def words(answer: Answer) -> str:
    """What a case conceals, in words."""
    if answer.group == "clean":
        return "nothing"
    places = [t.at for t in answer.truths] or [""] * len(answer.kinds)
    names = [f"{k.replace('_', ' ')}{f' at {at}' if at else ''}" for k, at in zip(answer.kinds, places, strict=True)]
    kind = "" if answer.group in ("single", "pair") else f" ({answer.group})"
    return f"{' and '.join(names)}{kind}, {answer.size:g}×"


def missed(c: Scored) -> bool:
    """Whether any figure counts the case against the method."""
    group = c.answer.group
    if group == "clean":
        return c.verdict != "adequate"
    if group == "outside":
        return c.verdict != "unknown_effect"
    if group == "wrong":
        return c.blamed or c.verdict not in ("adequate", "missing_physics")
    return not (c.name and c.place)


def explained(c: Scored, found: Diagnosed) -> str:
    """A sentence or two on a miss; empty where there is none."""
    if not missed(c):
        return ""
    if c.verdict == "failed":
        return f"No answer: {' '.join(found['notes'])}"
    parts: list[str] = []
    if c.name and not c.place:
        parts.append("The name is right, the joint is not.")
    if c.answer.group == "clean":
        parts.append(f"A false alarm. {_strength(found)}")
    elif c.verdict == "adequate":
        parts.append("Nothing was found worth a name.")
    elif c.verdict == "unknown_effect":
        parts.append(f"Heard, but not named: {found.get('description', '')}.")
    elif c.answer.group == "outside":
        parts.append(f"A name took its place. {_strength(found)}")
    for truth, value in zip(c.answer.truths, c.answer.value, strict=False):  # cases without a name have no truths
        if not _is_named(truth.name, truth.at, c):
            parts += [_screened(truth.name, truth.at, found), _limit(truth.name, truth.at, value, found)]
    wrong = [
        f"{e['name'].replace('_', ' ')} at {e['at']} (probability {e['probability']:.2f})"
        for e, (_, right) in zip(names_in(found), c.claims, strict=True)
        if not right
    ]
    if wrong and c.answer.truths:
        parts.append(f"Not concealed, but named: {', '.join(wrong)}.")
    if c.error is not None and c.answer.truths:
        parts.append(f"Error on the third recording over its floor: {c.error[0]:.2f} before, {c.error[1]:.2f} after.")
    return " ".join(p for p in parts if p)


def _is_named(name: str, at: str, c: Scored) -> bool:
    return any(n == name and joint(place) == joint(at) for n, place in c.named)


def _screened(name: str, at: str, found: Diagnosed) -> str:
    """What the first screening made of the right answer, and whether the holdout turned it down."""
    every = found.get("candidates", [])
    place = next((k for k, x in enumerate(every) if x["name"] == name and joint(x["at"]) == joint(at)), None)
    plain = name.replace("_", " ")
    if any(f"{name} at" in note and "not named" in note for note in found.get("notes", [])):
        return f"{plain} was named on the training recording, and the held-out one did not confirm it."
    if place is None:
        return f"{plain} at {at} explained nothing on top of the baseline."
    best, own = every[0], every[place]
    share = f"{100.0 * own['explained']:.1f} %"
    if place == 0:
        return f"{plain} explained most in the first screening ({share} of the residual), and was not taken."
    return (
        f"{plain} explained {share} of the residual in the first screening, number {place + 1} of {len(every)}; "
        f"{best['name'].replace('_', ' ')} at {best['at']} explained {100.0 * best['explained']:.1f} %."
    )


def _limit(name: str, at: str, value: float, found: Diagnosed) -> str:
    """What the answer itself claims that it would have seen."""
    own = [x for x in found.get("limits", []) if x["name"] == name and joint(x["at"]) == joint(at)]
    if not own:
        return ""
    claimed = ", ".join(f"{x['parameter'].replace('_', ' ')} {x['value']:.3g} {x['unit']}" for x in own)
    return f"It claims to see {claimed}; concealed was {value:.3g}."


def _strength(found: Diagnosed) -> str:
    if not names_in(found):
        return f"{found.get('description', '')}".capitalize()
    first = names_in(found)[0]
    return (
        f"{first['name'].replace('_', ' ').capitalize()} at {first['at']} has the probability "
        f"{first['probability']:.2f}, with {len(first['rivals'])} rivals."
    )
