"""How long a search goes on, and how far, halved and doubled."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from moved_numbers import FACTORS, move

from snarelab.identification import deciding
from snarelab.identification.arms import kind as arms
from snarelab.identification.decision import decide as deciding_all
from snarelab.identification.decision import search as rounds
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect


def searching(monkeypatch, rounds_with_news: int, law: str = "backlash") -> tuple[int, list[set[str]]]:
    """How many names a search has of which every round finds another, and what each round is not to name."""
    barred = []
    slot = SimpleNamespace(gain=10.0, shares=[1.0], taken=SimpleNamespace(hypothesis=0, item=0))
    members = SimpleNamespace(of=lambda _: [1.0])
    placed = PlacedEffect(get_effect(law), "a")
    made = SimpleNamespace(pool=[SimpleNamespace(named=True, label=placed)], members=lambda _: members)
    weighed = SimpleNamespace(noises=(), pool=made.pool)
    left = iter([[slot]] * rounds_with_news + [[]] * 99)

    def found(_, __, out, ___):
        barred.append(set(out))
        return weighed, made, next(left), 0.0

    kind: Any = SimpleNamespace(
        train=range(1),
        first=lambda _: "fit",
        weighed=lambda *_, **__: weighed,
        chosen=lambda _, __, large: [(s, large) for s in large],
        started=lambda *_: (placed, {}),
        fitted=lambda *_: "fit",
        closed=lambda *_: "fit",
    )
    stubs: dict[str, Any] = {
        "searched": found,
        "trials": lambda *_: (),
        "as_names": lambda _, slots: slots,
        "rivals": lambda *_: (),
        "reached": lambda *_: [],
        "_taken_out": lambda *_: np.zeros(1),
    }
    for name, stub in stubs.items():
        monkeypatch.setattr(rounds, name, stub)
    return len(rounds.search(kind).names), barred


def test_a_search_goes_on_for_so_many_rounds(monkeypatch):
    """Where every round finds something; with fewer it ends by itself."""
    assert [searching(monkeypatch, n)[0] for n in (1, 3, 4, 9)] == [1, 3, 4, 4]
    for factor, names in zip(FACTORS, (2, 8), strict=True):
        with monkeypatch.context() as patch:
            move(patch, "ROUNDS", factor)
            assert searching(patch, 9)[0] == names


def test_the_parts_of_a_whole_law_are_barred_once_it_is_named(monkeypatch):
    """Makkar's law writes the sum of four: none of them is looked for beside it, at its own joint."""
    first, *later = searching(monkeypatch, 2, "makkar_friction")[1]
    assert first == set()
    parts = ("viscous", "coulomb", "stribeck")
    assert all({f"{x}_friction.a" for x in parts} <= out for out in later)
    assert len(later) == 2
    assert searching(monkeypatch, 2, "coulomb_friction")[1] == [set()] * 3


def driven(monkeypatch) -> set[float]:
    """The shares of motion that may be driven, asked for of the first fit and of the second."""
    shares, nothing = set(), lambda *_, **__: None

    def planned(*_, driven, **__):
        shares.add(driven)
        return []

    stubs = {"planned": planned, "assemble": nothing, "fit": nothing, "fitted": nothing, "refitted": nothing}
    for name, stub in {**stubs, "library": lambda _: []}.items():
        monkeypatch.setattr(arms, name, stub)
    model: Any = SimpleNamespace(with_effects=lambda *_: model)
    arm, none = arms.ArmRecordings(model, None, {}, [], []), cast(Any, None)
    arm.fitted(arm.first(lambda _: None), [], {}, none)
    return shares


def test_how_much_of_a_motion_may_be_driven_is_what_an_arm_asks_for(monkeypatch):
    """What it then does to the band of a joint is in test_closed_loop.py: it goes with its fifth root."""
    assert driven(monkeypatch) == {deciding.DRIVEN}
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "DRIVEN", factor)
            assert driven(patch) == {factor * 0.01}


def attempts(monkeypatch) -> float:
    """How well the best attempt predicts, where each predicts better than the last and none is whole."""
    density = iter(range(99))
    name = SimpleNamespace(placed=SimpleNamespace(key="a"))
    monkeypatch.setattr(deciding_all, "search", lambda *_, **__: None)
    monkeypatch.setattr(deciding_all, "left_over", lambda *_: None)
    monkeypatch.setattr(
        deciding_all,
        "confirm",
        lambda *_: SimpleNamespace(rejected=(name,), found=None, forecast=SimpleNamespace(density=next(density))),
    )
    kind: Any = None
    return deciding_all.decide(kind).best.forecast.density


def test_what_was_not_confirmed_is_looked_for_again_twice(monkeypatch):
    assert attempts(monkeypatch) == 2
    for factor, best in zip(FACTORS, (1, 4), strict=True):
        with monkeypatch.context() as patch:
            move(patch, "SECOND_CHOICES", factor)
            assert attempts(patch) == best
