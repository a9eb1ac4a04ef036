"""The search over a capture's effects: which trial is named, which is rejected, and where the search ends."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from captures_by_hand import CLEARANCE, FRICTION, PRETENSION, UMBILICAL, fit_of

from snarelab.errors import InputError
from snarelab.identification.snare import search as module
from snarelab.identification.snare.search import demand_simulated, search, start_at
from snarelab.identification.snare.trials import CaptureTrial
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect

POOL = [FRICTION, PRETENSION, CLEARANCE, UMBILICAL]
BAR = np.log(4 / 0.005)
"""What the best of four candidates must reach: 6.68."""
MODEL: Any = SimpleNamespace(path="model.toml", effects=())


class Rounds:
    """Scores and shares of each round by candidate, and the likelihood of the held-out captures by what is fitted."""

    def __init__(self, monkeypatch, rounds, held, pool=POOL):
        self.rounds, self.held, self.asked, self.rivals, self.slopes = rounds, held, [], [], []
        stand_ins = {
            "library": lambda _: pool,
            "start_at": lambda *_: fit_of([], [], 0.0),
            "fit": lambda _, start: start,
            "evaluate": lambda _, placed, many: [fit_of(placed, many[0], self.held[tuple(placed)])],
            "try_all": self.try_all,
            "weigh": self.weigh,
            "with_slopes": self.with_slopes,
        }
        for name, stand_in in stand_ins.items():
            monkeypatch.setattr(module, name, stand_in)

    def try_all(self, _model, _captures, found, candidates, rejected, _progress):
        self.asked.append((tuple(candidates), tuple(rejected)))
        scores = self.rounds[len(self.asked) - 1]
        return tuple(
            CaptureTrial(p, fit_of((*found.placed, p), np.zeros(len(found.placed) + 1), 0.0), *scores[p])
            for p in candidates
            if p in scores
        )

    def weigh(self, _captures, trial, rivals, before, seed):
        self.rivals.append((trial.placed, [r.placed for r in rivals], before.placed, seed))
        return 0.75, ()

    def with_slopes(self, _captures, found):
        self.slopes.append(found.placed)
        return found

    def search(self, **options):
        sets: Any = SimpleNamespace(numbers=[0, 1], captures=[])
        return search(MODEL, sets, sets, **options)


def names(found):
    return [n.trial.placed for n in found.named]


@pytest.mark.parametrize(
    ("score", "explained", "named"),
    [(BAR + 0.01, 0.21, True), (BAR - 0.01, 0.9, False), (BAR, 0.9, False), (50.0, 0.2, False), (50.0, 0.21, True)],
)
def test_a_name_needs_a_score_above_the_bar_and_more_than_a_fifth_explained(score, explained, named, monkeypatch):
    """The bar is ln(candidates/0.005): what the best of four reaches by chance once in 200 times."""
    rounds = Rounds(monkeypatch, [{FRICTION: (score, explained)}, {}], {(): 0.0, (FRICTION,): 9.0})
    found = rounds.search()
    assert found.bar == pytest.approx(BAR, rel=1e-12)
    assert names(found) == ([FRICTION] if named else [])
    assert found.last.placed == ((FRICTION,) if named else ())
    assert rounds.slopes == [found.last.placed]
    assert found.rejected == ()


@pytest.mark.parametrize(("gain", "confirmed"), [(1.01, True), (1.0, False), (-3.0, False)])
def test_a_name_must_tell_the_held_out_captures_better_by_more_than_one(gain, confirmed, monkeypatch):
    """If it does not, the next best is tried, and the first one is not fitted again in later rounds."""
    first = {FRICTION: (30.0, 0.5), PRETENSION: (20.0, 0.5)}
    held = {(): 4.0, (FRICTION,): 4.0 + gain, (PRETENSION,): 6.0, (FRICTION, PRETENSION): 4.0}
    rounds = Rounds(monkeypatch, [first, {}], held)
    found = rounds.search()
    assert names(found) == [FRICTION if confirmed else PRETENSION]
    assert found.rejected == (() if confirmed else (FRICTION,))
    (named,) = found.named
    assert named.held_before.likelihood == found.held_first.likelihood == 4.0
    assert named.held_after.likelihood == found.held_last.likelihood == (4.0 + gain if confirmed else 6.0)
    assert rounds.asked[1] == (
        tuple(p for p in POOL if p is not names(found)[0]),
        () if confirmed else (FRICTION.key,),
    )
    assert [t.placed for t in found.opening] == [FRICTION, PRETENSION]


def test_a_second_name_is_measured_against_the_first():
    """Held out, 4 and then 9 with friction: with pretension beside it 10 is no more than one better, 10.5 is."""
    for held, count in ((10.0, 1), (10.5, 2)):
        with pytest.MonkeyPatch.context() as monkeypatch:
            told = {(): 4.0, (FRICTION,): 9.0, (FRICTION, PRETENSION): held}
            rounds = [{FRICTION: (30.0, 0.5)}, {PRETENSION: (30.0, 0.5)}, {}]
            assert len(Rounds(monkeypatch, rounds, told).search().named) == count


def test_what_was_rejected_is_not_named_later_however_well_it_does():
    held = {(): 4.0, (FRICTION,): 4.0, (PRETENSION,): 9.0}
    with pytest.MonkeyPatch.context() as monkeypatch:
        rounds = [{FRICTION: (30.0, 0.5), PRETENSION: (20.0, 0.5)}, {FRICTION: (90.0, 0.9)}]
        found = Rounds(monkeypatch, rounds, held).search()
    assert names(found) == [PRETENSION]
    assert found.rejected == (FRICTION,)


def test_rivals_are_candidates_with_more_than_a_fifth_of_the_best_score(monkeypatch):
    scores = {FRICTION: (30.0, 0.5), PRETENSION: (6.0, 0.9), CLEARANCE: (6.1, 0.0), UMBILICAL: (-2.0, 0.0)}
    rounds = Rounds(monkeypatch, [scores, {}], {(): 0.0, (FRICTION,): 9.0})
    found = rounds.search(seed=7)
    assert rounds.rivals == [(FRICTION, [CLEARANCE], (), 7)]
    assert found.named[0].margin == 0.75


def test_a_search_ends_after_four_names_or_with_the_last_candidate(monkeypatch):
    """Five candidates, each of which would be named."""
    fifth = PlacedEffect(get_effect("contact_damping"), "pin")
    for pool in ([*POOL, fifth], POOL[:2]):
        held = {tuple(pool[:k]): 10.0 * k for k in range(len(pool) + 1)}
        rounds = Rounds(monkeypatch, [{p: (30.0, 0.5)} for p in pool], held, pool)
        found = rounds.search()
        assert names(found) == pool[: min(4, len(pool))]
        assert len(rounds.asked) == min(4, len(pool))
        assert [t.placed for t in found.opening] == pool[:1]


def test_what_is_in_the_model_by_name_is_no_candidate(monkeypatch):
    rounds = Rounds(monkeypatch, [{}], {(PRETENSION,): 0.0})
    monkeypatch.setattr(module, "start_at", lambda *_: fit_of([PRETENSION], [100.0], 0.0))
    rounds.search()
    assert rounds.asked[0][0] == (FRICTION, CLEARANCE, UMBILICAL)


@pytest.mark.parametrize("which", ["fitted", "held out"])
def test_a_model_that_cannot_be_simulated_is_refused(which, monkeypatch):
    lost = fit_of([], [], -np.inf)
    with pytest.raises(InputError, match=r"model\.toml: the capture cannot be simulated from where"):
        demand_simulated(MODEL, lost)
    fine = fit_of([], [], -5.0)
    assert demand_simulated(MODEL, fine) is fine
    rounds = Rounds(monkeypatch, [{}], {(): -np.inf if which == "held out" else 0.0})
    if which == "fitted":
        monkeypatch.setattr(module, "start_at", start_at)
        monkeypatch.setattr(module, "start_of", lambda _: np.zeros(0))
        monkeypatch.setattr(module, "started", lambda *_: lost)
    with pytest.raises(InputError, match=r"check \[capture\] against the test's set-up"):
        rounds.search()


@pytest.mark.parametrize("pool", [[], [FRICTION]])
def test_a_single_candidate_faces_a_bar_of_its_own_and_none_ends_the_search(pool, monkeypatch):
    """ln(1/0.005) = 5.298: for one candidate, and where there is none."""
    rounds = Rounds(monkeypatch, [{FRICTION: (5.31, 0.5)}], {(): 0.0, (FRICTION,): 9.0}, pool)
    found = rounds.search()
    assert found.bar == pytest.approx(-np.log(0.005), rel=1e-12)
    assert names(found) == pool
    assert len(rounds.asked) == len(pool)
