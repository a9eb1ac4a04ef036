"""Judge what was said of a case against its truth.

A told class is the name given and the rivals that the tool says cannot be told from it. It is right if one of its
members is concealed in the case, at that joint (joint2, link2 and tau.joint2 are one place). A name that is true of
every case's background (a URDF that is off, bristles that the model lacks) is neither right nor wrong. A law that was
drawn as one without a name and has got one since is told rightly by that name, and as unknown.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..judge import AUDIBLE, is_physics
from .nameless import NAMED_SINCE
from .places import joint

Line = Mapping[str, Any]
Place = tuple[str, str]


@dataclass(frozen=True)
class Told:
    """A class that was told. ``first``: its own name is right at its place; ``member``: one of its class is.

    ``background``: it is true of the background, and nothing else. ``probability``: of the whole class.
    """

    name: str
    at: str
    probability: float
    first: bool
    member: bool
    background: bool


@dataclass(frozen=True)
class Found:
    """One concealed effect. ``name``: told anywhere, as a name; ``placed``: at its joint; ``member``, ``anywhere``:
    the same for a member of a class. ``deviations``: of its comparable values, (told - true) / std.
    """

    name: str
    size: float
    named: bool
    placed: bool
    member: bool
    anywhere: bool
    deviations: tuple[float, ...]

    @property
    def credit(self) -> float:
        """1 for the name at its place, half for a member of a class there."""
        return 1.0 if self.placed else 0.5 if self.member else 0.0


@dataclass(frozen=True)
class Judged:
    """A case: its classes, its concealed effects, and whether all was right and nothing else said.

    ``fault``: nothing but a parameter or a sensor is wrong. ``closure``: (before - after) / (before - oracle) of the
    RMS on the third recording, where what is concealed shows most; None where that was not recorded. ``unknown``: a law
    without a name is told as such, beside whatever names; ``nameless``: something is told that has no name.
    """

    group: str
    disturbance: str
    size: float
    verdict: str
    told: tuple[Told, ...]
    found: tuple[Found, ...]
    unknown: bool
    located: bool
    known: tuple[float, ...]
    seconds: float
    fault: bool
    closure: float | None
    classes: tuple[tuple[Place, ...], ...]
    nameless: bool = False

    @property
    def wrong(self) -> list[Told]:
        """Told, and neither right nor true of the background."""
        return [t for t in self.told if not t.member and not t.background]

    @property
    def whole(self) -> bool:
        """Every concealed effect in a class at its place, and nothing wrong."""
        return bool(self.found) and all(f.member for f in self.found) and not self.wrong

    @property
    def blamed(self) -> bool:
        """Physics is named that is not true of the background, or something without a name is told of."""
        physics = [
            t for t, own in zip(self.told, self.classes, strict=True) if all(is_physics(name) for name, _ in own)
        ]
        return any(not t.background for t in physics) or self.verdict not in ("adequate", "missing_physics")


def judge(line: Line) -> Judged:
    """Judge a line of `score`."""
    truth = line["truth"]
    named = [e for e in truth["effects"] if e["name"]]
    lawless = [e for e in truth["effects"] if not e["name"]]
    since = {(NAMED_SINCE[e["law"]], joint(e["at"])) for e in lawless if e["law"] in NAMED_SINCE}
    right = {(e["name"], joint(e["at"])) for e in named} | since
    told, classes = [], []
    for effect in line["effects"]:
        members = [(effect["name"], effect["at"])]
        members += [(r["name"], r["at"]) for r in effect["rivals"] if not r["separable"]]
        classes.append(members)
        hits = [(name, joint(at)) in right for name, at in members]
        shared = sum(r["probability"] for r in effect["rivals"] if not r["separable"])
        told.append(
            Told(
                effect["name"],
                effect["at"],
                min(float(effect["probability"]) + shared, 1.0),
                hits[0],
                any(hits),
                not any(hits) and effect["name"] in truth["background"],
            )
        )
    by_name = any((e["name"], joint(e["at"])) in since for e in line["effects"])
    location, nameless = line.get("location", {}), line.get("description", "")
    loudest = max(location, key=lambda channel: location[channel], default="")
    return Judged(
        truth["group"],
        truth["disturbance"]["kind"],
        max((e["size"] for e in truth["effects"]), default=0.0),
        line["verdict"],
        tuple(told),
        tuple(_found(e, line["effects"], classes) for e in named),
        bool(lawless)
        and (by_name or line["verdict"] == "unknown_effect" or f"on {lawless[0]['channel']}," in nameless),
        bool(lawless) and loudest == lawless[0]["channel"],
        tuple(_known(line)),
        float(line["seconds"]),
        truth["group"] == "wrong" or (bool(named) and not any(is_physics(e["name"]) for e in named) and not lawless),
        closure(line["third"], sorted({e["channel"] for e in truth["effects"]})) if "third" in line else None,
        tuple(map(tuple, classes)),
        line["verdict"] == "unknown_effect" or bool(nameless),
    )


def closure(third: Mapping[str, Sequence[float]], channels: Sequence[str]) -> float | None:
    """Share of the way to the oracle, over channels each by its oracle; 1 or 0 where the oracle leaves nothing to
    close, and that stayed so or did not. ``third``: RMS before, after and of the oracle [N·m], by channel."""
    rows = np.array([third[c] for c in channels if c in third])
    if rows.size == 0:
        return None
    before, after = np.sqrt(np.mean(np.square(rows[:, :2] / rows[:, 2:]), axis=0))
    if before <= AUDIBLE:
        return float(after <= AUDIBLE)
    return float((before - after) / (before - 1.0))


def _found(truth: Mapping[str, Any], effects: Sequence[Mapping[str, Any]], classes: Sequence[list[Place]]) -> Found:
    name, where = truth["name"], joint(truth["at"])
    own = [e for e in effects if e["name"] == name and joint(e["at"]) == where]
    deviations = []
    if own:
        estimates = own[0]["parameters"]
        for parameter, value in truth["values"].items():
            estimate = estimates.get(parameter)
            if estimate and estimate["std"] and not estimate.get("at_bound", False):
                deviations.append((estimate["value"] - value) / estimate["std"])
    return Found(
        name,
        truth["size"],
        any(e["name"] == name for e in effects),
        bool(own),
        any((name, where) == (n, joint(at)) for members in classes for n, at in members),
        any(name == n for members in classes for n, _ in members),
        tuple(deviations),
    )


def _known(line: Line) -> list[float]:
    """Deviations of friction and rotor inertia that the model has, where nothing is concealed."""
    if line["truth"]["group"] != "clean":
        return []
    values = {
        f"{effect}.{at}.{parameter}": value
        for key, by_joint in line["truth"]["known"].items()
        for effect, parameter in [key.split(".")]
        for at, value in by_joint.items()
    }
    moved = [m for m in line.get("moved", []) if m["name"] in values and m["std"]]
    return [(m["after"] - values[m["name"]]) / m["std"] for m in moved]
