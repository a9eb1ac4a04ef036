"""Whether a part of a friction law can be told from the whole: heights on both sides of what would have been seen."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest

from snarelab.identification.search import whole_law
from snarelab.identification.search.choice import RivalOdds, Taken
from snarelab.identification.search.whole_law import beside_whole_laws, whole_laws
from snarelab.models.effects import get_effect
from snarelab.models.model import Placed

SPEED = np.array([[-3.0], [0.5], [2.0]])


def placed(name: str, at: str = "joint1") -> Placed:
    return Placed(get_effect(name), at)


def wholes(monkeypatch, level, limits, named="coulomb_friction", also=(), judged=None):
    """A level at joint 1 that is named, and the limits of others by name."""
    names = [placed(named), *also]
    monkeypatch.setattr(whole_law, "without", lambda final, p: Made(
        joint_of=lambda _: 0, torque=lambda e, theta: np.full((3, 1), 10.0)))  # fmt: skip
    monkeypatch.setattr(whole_law, "carry", lambda *_: None)
    final: Any = Made(assembly=Made(placed=names, torque=lambda e, theta: 10.0 + level * np.sign(SPEED)), theta=None)
    columns = {
        "viscous_friction": SPEED,
        "stribeck_friction": np.exp(-np.abs(SPEED)),
        "coulomb_friction": 1 + 0 * SPEED,
    }
    closing: Any = Made(
        judged=[
            Made(placed=placed(n), variant=None, everywhere=lambda _, x=columns[n]: {0: [x[:1], x[1:]]})
            for n in (limits if judged is None else judged)
        ],
        limits=[Made(name=n, at="joint1", value=x) for n, x in limits.items()],
    )
    return [p.key for p in whole_laws(names[0], final, closing, [Made()])]  # pyright: ignore[reportArgumentType]


BUMP = float(np.exp(-0.5))


@pytest.mark.parametrize(
    ("viscous", "stribeck", "found"),
    [
        (1.01 / 3, 1.01 / BUMP, True),  # at their peaks, just taller than the level of one
        (0.99 / 3, 1.01 / BUMP, False),  # viscous friction as tall as that would have been seen
        (1.01 / 3, 0.99 / BUMP, False),
    ],
)
def test_a_part_is_the_whole_law_if_nothing_as_tall_would_have_been_seen_beside_it(
    monkeypatch, viscous, stribeck, found
):
    limits = {"viscous_friction": viscous, "stribeck_friction": stribeck}
    assert wholes(monkeypatch, 1.0, limits) == (["makkar_friction.joint1"] if found else [])
    assert wholes(monkeypatch, -1.0, limits) == (["makkar_friction.joint1"] if found else [])


def test_what_the_model_has_already_is_no_part_that_could_be_missing(monkeypatch):
    limits = {"stribeck_friction": 1.01 / BUMP}
    assert wholes(monkeypatch, 1.0, limits) == []  # of viscous friction nothing is known
    assert wholes(monkeypatch, 1.0, limits, also=[placed("viscous_friction")]) == ["makkar_friction.joint1"]
    assert wholes(monkeypatch, 1.0, limits, also=[placed("viscous_friction", "joint2")]) == []
    every = [placed("viscous_friction"), placed("stribeck_friction")]
    assert wholes(monkeypatch, 1.0, {}, also=every) == []  # nothing is left that the whole law has besides
    assert wholes(monkeypatch, 1.0, limits, also=[placed("viscous_friction"), placed("makkar_friction")]) == []


def test_a_limit_without_columns_says_nothing(monkeypatch):
    limits = {"viscous_friction": 9.0, "stribeck_friction": 9.0}
    assert wholes(monkeypatch, 1.0, limits, judged=["viscous_friction"]) == []
    assert wholes(monkeypatch, 1.0, limits, named="sensor_bias") == []


@pytest.mark.parametrize("unseen", [False, True])
def test_wins_are_shared_with_the_whole_law(monkeypatch, unseen):
    makkar, other = placed("makkar_friction"), RivalOdds(placed("load_dependent_friction"), 0.1, True)
    monkeypatch.setattr(whole_law, "whole_laws", lambda *_: [makkar] * unseen)
    judged: Any = Made(placed=placed("coulomb_friction"))
    taken = Taken(judged, 0.8, (other, RivalOdds(makkar, 0.02, True)), 5.0)
    none: Any = Made()
    both = beside_whole_laws(taken, none, none, [])
    if not unseen:
        assert both is taken
        return
    assert (both.probability, both.gained) == (0.4, 5.0)
    assert both.rivals == (RivalOdds(makkar, 0.4, False), other)
