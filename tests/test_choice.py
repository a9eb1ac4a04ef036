"""The choice among candidates that pass: what contains what, who goes first, and a bootstrap counted by hand."""

from collections.abc import Callable
from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest

from snarelab.identification.search import choice
from snarelab.identification.search.choice import BOOTSTRAPS, Taken, choose, is_all, weigh, widest
from snarelab.identification.search.evidence import Channel, Evidence
from snarelab.identification.search.judged import Judged
from snarelab.models.effects import get_effect
from snarelab.models.model import Placed

IN_MOTION, NEAR_REST = "samples in motion", "samples near rest"


def judged(name, at="link1", score=10.0, *, channels=(0,), price=0.0, hold=(), columns=None, **more) -> Any:
    case: Any = Made(evidence=IN_MOTION, **more)
    none: Any = None
    variant: Any = Made(low=np.full(1, -np.inf), high=np.full(1, np.inf))
    placed = Placed(get_effect(name), at, hold)
    return Judged(variant, placed, np.zeros(1), score, price, 0.5, channels, case, columns or {}, none)


@pytest.mark.parametrize(
    ("wide", "at", "other", "whole"),
    [
        ("backlash", "joint1", "joint_elasticity", True),
        ("backlash", "joint2", "joint_elasticity", False),  # at another place
        ("joint_elasticity", "joint1", "backlash", False),  # the other way about
        ("stribeck_friction", "joint1", "coulomb_friction", False),  # levels of friction add up
        ("inertia_error", "joint1", "payload_mass", True),
    ],
)
def test_an_effect_is_all_that_its_special_case_is_at_its_own_place(wide, at, other, whole):
    assert is_all(judged(wide, at), judged(other, "joint1")) is whole


def taken(*several):
    return [Taken(j, 1.0, (), 0.0) for j in several]


def test_the_widest_of_a_candidate_and_what_was_taken_stands_for_both_with_all_parameters_free():
    play, spring = judged("backlash", "joint1", hold=("gap",)), judged("joint_elasticity", "joint1", hold=("damping",))
    other = judged("viscous_friction", "joint2", hold=("coefficient",))
    for new, before in ((play, spring), (spring, play)):
        found = widest(new, taken(other, before))
        assert found is not None
        assert (found.placed.effect.name, found.placed.hold) == ("backlash", ())


def test_a_special_case_of_what_was_taken_whole_is_no_news():
    spring = judged("joint_elasticity", "joint1")
    assert widest(spring, taken(judged("backlash", "joint1"))) is None
    elsewhere = widest(spring, taken(judged("backlash", "joint2")))
    assert elsewhere is spring
    assert widest(spring, []) is spring


@pytest.mark.parametrize(
    ("score", "at", "first"), [(114.0, "link1", False), (116.0, "link1", True), (100.0, "l", True)]
)
def test_what_contains_a_special_case_must_explain_more_by_a_seventh(score, at, first):
    """1.15 times the 100 that the payload at the same link explains."""
    whole, special = judged("inertia_error", "link1", score), judged("payload_mass", at, 100.0)
    (found,) = choose(Made(), [whole, special])  # pyright: ignore[reportArgumentType]
    assert found is (whole if first else special)


def test_one_candidate_for_each_channel_and_none_on_a_channel_that_a_better_one_reached():
    result: Any = Made()
    best, worse, other = (
        judged(name, at, score, channels=(c,))
        for name, at, score, c in (
            ("viscous_friction", "joint1", 30.0, 0),
            ("coulomb_friction", "joint1", 20.0, 0),
            ("rotor_inertia", "joint2", 10.0, 1),
        )
    )
    assert choose(result, [best, worse, other]) == [best, other]
    assert choose(result, []) == []


def together(monkeypatch, table):
    """Scores of several candidates at once, from a table by their effects' names."""

    def score(_result: Any, several: Any) -> float:
        return table[frozenset(j.placed.effect.name for j in several)]

    monkeypatch.setattr(choice, "_together", score)


WIDE, HERE, THERE = "payload_mass", "viscous_friction", "rotor_inertia"


@pytest.mark.parametrize(
    ("with_here", "with_there", "all_local", "wide_first"),
    [
        # Alone the wide one scores 50; a local effect beside it must add more than the 7 that noise reaches.
        (57.0, 57.0, 50.0, True),
        (57.0, 57.0, 51.0, False),
        (58.0, 57.0, 58.0, True),  # the first is needed beside it, and with it both stories are as good
        (58.0, 57.0, 58.1, False),
        (58.0, 59.0, 70.0, True),  # both are needed: 70
        (58.0, 59.0, 70.1, False),
    ],
)
def test_a_wide_effect_goes_first_if_it_tells_a_better_story_than_the_local_ones(
    monkeypatch, with_here, with_there, all_local, wide_first
):
    scores = {(WIDE,): 50.0, (WIDE, HERE): with_here, (WIDE, THERE): with_there, (HERE, THERE): all_local}
    together(monkeypatch, {frozenset(k): v for k, v in scores.items()} | {frozenset((WIDE, HERE, THERE)): 70.0})
    wide = judged(WIDE, "link1", 60.0, channels=(0, 1))
    here, there = judged(HERE, "joint1", 30.0), judged(THERE, "joint2", 20.0, channels=(1,))
    weaker = judged("coulomb_friction", "joint1", 25.0)  # not the best on its channel: it has no say
    found = choose(Made(threshold={(0,): 7.0, (1,): 7.0}), [wide, here, weaker, there])  # pyright: ignore[reportArgumentType]
    assert found == ([wide] if wide_first else [here, there])


def test_a_wide_effect_that_comes_second_keeps_weaker_ones_off_all_its_channels(monkeypatch):
    """It does not act beside the better local one, but what it says of the other channel is said first."""
    here, wide = judged(HERE, "joint1", 80.0), judged(WIDE, "link1", 60.0, channels=(0, 1))
    late = judged("com_offset", "link2", 20.0, channels=(1, 2))
    table = {frozenset((WIDE,)): 50.0, frozenset((WIDE, HERE)): 50.0, frozenset((HERE,)): 40.0}
    together(monkeypatch, table)
    assert choose(Made(threshold={(0,): 7.0}), [here, wide, late]) == [here]  # pyright: ignore[reportArgumentType]


def unit(n, k):
    return np.eye(n)[:, [k]]


def test_what_several_explain_together_is_their_common_regression_less_all_prices():
    """Unit columns. The first alone on channel 0 meets 6: ½·6². The second, on both channels, meets 4 and 2, in all 6
    on a length of 2: ½·6²/2. Prices 1 and 2. A bound of 3 on the first leaves it 6·3 - ½·3²."""
    n, baseline = 12, unit(12, 5)
    residuals = [6.0 * unit(n, 0)[:, 0] + 4.0 * unit(n, 1)[:, 0], 2.0 * unit(n, 1)[:, 0]]
    block = np.arange(n) // 4
    evidence = Evidence([Channel(np.array([c]), baseline, r, np.ones(n), block) for c, r in enumerate(residuals)], 2, 3)
    first = judged(HERE, "joint1", price=1.0, columns={0: unit(n, 0)})
    second = judged(WIDE, "link1", channels=(1, 0), price=2.0, columns={0: unit(n, 1), 1: unit(n, 1)})
    result: Any = Made(evidence=evidence)
    assert choice._together(result, [first, second]) == pytest.approx(18.0 + 9.0 - 3.0)
    first.variant.high[0] = 3.0
    assert choice._together(result, [first, second]) == pytest.approx(13.5 + 9.0 - 3.0)
    # Of this column the baseline mimics all but 0.0016: little, and enough to be heard.
    nearly = judged("rotor_inertia", "joint1", price=0.5, columns={0: 0.04 * unit(n, 0) + baseline})
    assert choice._together(result, [nearly, second]) == pytest.approx(18.0 + 9.0 - 2.5)


def rival(name, gain, *, at="joint1", score=10.0, price=0.0, channels=(0,), near_rest=None, samples=IN_MOTION) -> Any:
    """A candidate that gains this much on the only block, and another amount where samples near rest count."""

    def with_gain(value: float | None, evidence: str) -> Any:
        case = Made(shares=lambda: np.array([value]), fresh_gains=lambda: np.array([gain, 0.5]), evidence=evidence)
        return Made(
            placed=Placed(get_effect(name), at),
            score=score,
            price=price,
            channels=channels,
            case=case,
            signal=lambda: name,
            among=lambda _samples: with_gain(near_rest, NEAR_REST),
        )

    return with_gain(gain, samples)


def weighed(best, others, likeness: float | Callable[[str, str], float] = 0.0):
    """With one block every bootstrap is the recording itself: wins are all or none."""
    alike = likeness if callable(likeness) else lambda _a, _b: likeness
    evidence = Made(n_blocks=1, likeness=alike)
    result: Any = Made(evidence=evidence, near_rest=Made(evidence=NEAR_REST))
    return weigh(result, best, [best, *others], 0)


ALL, SOME = BOOTSTRAPS + 0.5, BOOTSTRAPS / 2 + 0.5
"""Wins of one that always wins, and of two that always share; each has half a win more than was seen."""


@pytest.mark.parametrize(
    ("gain", "prices", "wins"),
    [
        (9.85, (0.0, 0.0), ALL),
        (9.95, (0.0, 0.0), SOME),  # a tenth apart is as good
        (10.05, (0.0, 0.0), SOME),
        (10.15, (0.0, 0.0), 0.5),
        (12.0, (0.0, 3.0), ALL),  # 12 less its price is 9
        (9.0, (3.0, 0.0), 0.5),  # the best pays, too
    ],
)
def test_the_share_of_bootstraps_won(gain, prices, wins):
    best, other = rival("rotor_inertia", 10.0, price=prices[0]), rival("harness_stiffness", gain, price=prices[1])
    found = weighed(best, [other])
    total = BOOTSTRAPS + 1.0
    assert found.probability == pytest.approx(wins / total, rel=1e-12)
    assert [r.probability for r in found.rivals] == pytest.approx([1 - wins / total], rel=1e-9)
    assert found.gained == 10.5  # 10 and ½ on the blocks left out
    assert found.judged is best


@pytest.mark.parametrize(
    ("gain", "likeness", "separable"),
    [(9.0, 0.979, True), (9.0, 0.98, False), (9.95, 0.0, False)],  # one lost always and alike or not; one shared
)
def test_a_rival_can_be_told_apart_if_it_hardly_ever_wins_and_explains_something_else(gain, likeness, separable):
    (other,) = weighed(rival("rotor_inertia", 10.0), [rival("harness_stiffness", gain)], likeness).rivals
    assert other.separable is separable


@pytest.mark.parametrize(
    ("other", "counts"),
    [
        (rival("harness_stiffness", 1.0, score=2.001), True),
        (rival("harness_stiffness", 1.0, score=2.0), False),  # a fifth of the best
        (rival("harness_stiffness", 1.0, channels=(1,)), False),
        (rival("payload_mass", 1.0, channels=(1, 0)), True),
        (rival("backlash", 1.0), False),  # it contains the best at the same place
        (rival("backlash", 1.0, at="joint2"), True),
    ],
)
def test_who_is_a_rival(other, counts):
    assert len(weighed(rival("joint_elasticity", 10.0), [other], 0.5).rivals) == counts


@pytest.mark.parametrize(
    ("gain", "likeness", "at", "won"),
    [
        (11.4, 0.99, "joint1", False),  # 11.4 / 1.15 = 9.91: short of 10 by less than a tenth, and so shared
        (11.3, 0.99, "joint1", True),  # 9.83
        (20.0, 0.98, "joint1", None),  # not alike: a special case of it, and no rival
        (11.3, 0.5, "joint2", True),  # at another link it is a rival, and must explain plainly more, too
    ],
)
def test_all_of_a_links_inertia_is_a_rival_of_its_mass_if_it_explains_plainly_more(gain, likeness, at, won):
    found = weighed(rival("payload_mass", 10.0), [rival("inertia_error", gain, at=at)], likeness)
    if won is None:
        assert (found.rivals, found.probability) == ((), 1.0)
    else:
        assert found.probability == pytest.approx((ALL if won else SOME) / (BOOTSTRAPS + 1))


def test_where_one_was_judged_near_rest_all_compare_there():
    best = rival("viscous_friction", 10.0, near_rest=3.0)
    other = rival("coulomb_friction", 5.0, near_rest=5.0, samples=NEAR_REST)
    assert weighed(best, [other]).probability == pytest.approx(0.5 / (BOOTSTRAPS + 1))
    other = rival("coulomb_friction", 5.0, near_rest=5.0)
    assert weighed(best, [other]).probability == pytest.approx(ALL / (BOOTSTRAPS + 1))


def test_the_best_eight_are_weighed_and_four_rivals_are_told_likeliest_first():
    """Gains of 10 for the best and the eighth of its rivals; the seven before share a win in turn."""
    gains = [1.0, 2.0, 3.0, 10.0, 5.0, 6.0, 7.0, 10.0]
    several = [rival("harness_stiffness", g, at=f"joint{k}") for k, g in enumerate(gains, 1)]
    found = weighed(rival("rotor_inertia", 10.0), several)
    total = BOOTSTRAPS + 4.0  # half a win more for each of eight
    assert found.probability == pytest.approx(SOME / total)
    assert [r.placed.at for r in found.rivals] == ["joint4", "joint1", "joint2", "joint3"]
    assert [r.probability for r in found.rivals] == pytest.approx([SOME / total, *(3 * [0.5 / total])])
