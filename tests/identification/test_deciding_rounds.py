"""How long a search goes on, and how far, halved and doubled."""

from types import SimpleNamespace
from typing import Any

from moved_numbers import FACTORS, move

from snarelab.identification import deciding
from snarelab.identification.evidence import diagnose as deciding_all
from snarelab.identification.evidence import rounds
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect


def searching(monkeypatch, rounds_with_news: int, law: str = "backlash") -> tuple[int, set[float], list[set[str]]]:
    """How many names a search has of which every round finds another, the shares of motion that may be driven, and
    what each round is not to name."""
    shares, barred = set(), []

    def planned(*_, driven, **__):
        shares.add(driven)
        return [None]

    slot = SimpleNamespace(gain=10.0, taken=SimpleNamespace(hypothesis=0))
    made = SimpleNamespace(members=lambda _: SimpleNamespace(value=20.0), scan=lambda _: SimpleNamespace(odds=[1.0]))
    weighed = SimpleNamespace(noises=(), pool=[SimpleNamespace(named=True, label=PlacedEffect(get_effect(law), "a"))])
    left = iter([[slot]] * rounds_with_news + [[]] * 99)

    def found(_, __, out, ___):
        barred.append(set(out))
        return weighed, made, next(left), 0.0

    model: Any = SimpleNamespace(with_effects=lambda *_: model)
    stubs: dict[str, Any] = {
        "assemble": lambda *_: None, "fit": lambda *_, **__: None, "fitted": lambda *_: None, "planned": planned,
        "refitted": lambda *_: None, "weigh": lambda *_, **__: weighed,
        "searched": found,
        "_trials": lambda *_: (), "as_names": lambda _, slots: slots, "_error_of_laws": lambda *_: [0.0],
        "_reached": lambda *_: [0], "_tuned": lambda *_: {},
        "_name": lambda *_: (SimpleNamespace(placed=weighed.pool[0].label, channels=(0,)), {}),
    }  # fmt: skip
    for name, stub in stubs.items():
        monkeypatch.setattr(rounds, name, stub)
    return len(rounds.search(model, None, {}, [], []).names), shares, barred


def test_a_search_goes_on_for_so_many_rounds(monkeypatch):
    """Where every round finds something; with fewer it ends by itself."""
    assert [searching(monkeypatch, n)[0] for n in (1, 3, 4, 9)] == [1, 3, 4, 4]
    for factor, names in zip(FACTORS, (2, 8), strict=True):
        with monkeypatch.context() as patch:
            move(patch, "ROUNDS", factor)
            assert searching(patch, 9)[0] == names


def test_the_parts_of_a_whole_law_are_barred_once_it_is_named(monkeypatch):
    """Makkar's law writes the sum of four: none of them is looked for beside it, at its own joint."""
    first, *later = searching(monkeypatch, 2, "makkar_friction")[2]
    assert first == set()
    parts = ("viscous", "coulomb", "stribeck")
    assert all({f"{x}_friction.a" for x in parts} <= out for out in later)
    assert len(later) == 2
    assert searching(monkeypatch, 2, "coulomb_friction")[2] == [set()] * 3


def test_how_much_of_a_motion_may_be_driven_is_what_the_search_asks_for(monkeypatch):
    """What it then does to the band of a joint is in test_closed_loop.py: it goes with its fifth root."""
    assert searching(monkeypatch, 2)[1] == {deciding.DRIVEN}
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "DRIVEN", factor)
            assert searching(patch, 2)[1] == {factor * 0.01}


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
    model: Any = None
    return deciding_all.decide(model, None, {}, [], []).best.forecast.density


def test_what_was_not_confirmed_is_looked_for_again_twice(monkeypatch):
    assert attempts(monkeypatch) == 2
    for factor, best in zip(FACTORS, (1, 4), strict=True):
        with monkeypatch.context() as patch:
            move(patch, "SECOND_CHOICES", factor)
            assert attempts(patch) == best
