"""Every deciding number, halved and doubled: an answer that stands at it must change.

Those of captures and of encoders have theirs where these are tested.
"""

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from explained import Explained, hypotheses, white
from test_bursts import windows
from test_sticking import near_rest

from snarelab.identification import deciding
from snarelab.identification.evidence import arm, beside, rounds, tolerant
from snarelab.identification.evidence import confirm as confirming
from snarelab.identification.evidence import diagnose as deciding_all
from snarelab.identification.evidence import hypotheses as hypothesising
from snarelab.identification.evidence.beside import Beside
from snarelab.identification.evidence.evidence import Channel, Evidence, Projected
from snarelab.identification.evidence.hypotheses import pool
from snarelab.identification.evidence.members import Members
from snarelab.identification.evidence.pool import Columns, Hypothesis, Item
from snarelab.identification.evidence.search import Search
from snarelab.identification.nuisance import rest
from snarelab.identification.nuisance.bursts import bursts
from snarelab.identification.nuisance.noise import Run, learn
from snarelab.identification.nuisance.rest import Zone
from snarelab.identification.search.candidates import Variant
from snarelab.models.effects import get_effect
from snarelab.models.model import Placed

FACTORS = (0.5, 2.0)


def move(monkeypatch, name: str, factor: float) -> None:
    """A number times a factor wherever it was imported to."""
    value = getattr(deciding, name)
    moved: Any = (factor * np.array(value)).tolist() if isinstance(value, tuple) else factor * value
    moved = int(moved) if isinstance(value, int) else moved
    for module in [m for n, m in sys.modules.items() if n.startswith("snarelab.identification")]:
        own = getattr(module, name, None)
        if own is not None:
            monkeypatch.setattr(module, name, _as(own, moved))


def _as(own: Any, moved: Any) -> Any:
    """A number as a module holds it: an array, one zone or several, or as it is."""
    if isinstance(own, Zone):
        return Zone(*moved)
    if isinstance(own, tuple):
        return tuple(_as(x, y) for x, y in zip(own, moved, strict=True))
    return np.array(moved) if isinstance(own, np.ndarray) else moved


def planted(size: float) -> Explained:
    """One of ten columns stands in the residual, with nothing else: its score is what noise leaves on average."""
    made = white(np.random.default_rng(0), 10, {})
    (x,) = made.columns.parts[0, 0]
    x[:] = np.linalg.qr(x)[0] * np.sqrt(len(x))
    own = made.pieces[0][0]
    made.pieces[0][0] = Channel(size * x[:, 0], own.covariance, own.index, own.columns)
    return made


def smallest(named) -> float:
    """The smallest size that is named, by bisection."""
    low, high = 1e-3, 3.0
    assert named(high)
    assert not named(low)
    for _ in range(25):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if named(middle) else (middle, high)
    return high


def searched(made: Explained, several) -> bool:
    return bool(Search(Projected(made.evidence(), (0,)), several).answer())


def odds_of(made: Explained):
    """The hypotheses as an arm has them: six effects, the first at five joints; four curves."""
    effects = ("viscous_friction",) * 5 + ("coulomb_friction",)
    placed = [Placed(get_effect(n), f"joint{k}") for k, n in enumerate(effects)]
    named = {p.key: (p, [x]) for p, x in zip(placed, made.items, strict=False)}
    return pool(named, {(0, f"curve {k}"): x for k, x in enumerate(made.items[6:])}, ())


def test_priors_are_shared_by_effects_and_by_places():
    several = odds_of(white(np.random.default_rng(0), 10, {}))
    one_of_five = 0.5 / 5 + 0.5 / 25
    assert [np.exp(h.prior) for h in several] == pytest.approx([0.5 / 2 * one_of_five] * 5 + [0.5 / 2] + [0.2 / 4] * 4)
    assert [h.named for h in several] == [True] * 6 + [False] * 4


@pytest.mark.parametrize(("constant", "first"), [("ODDS_OF_NAMES", 0), ("ODDS_OF_CURVES", 6)])
def test_the_smallest_that_is_told_hangs_on_the_prior_odds(monkeypatch, constant, first):
    """ln 2 more or less of log Bayes factor; a size that is told with double the odds is not told with half of them."""

    def told(size):
        made = planted(size)
        order = [first, *(k for k in range(10) if k != first)]
        items = [made.items[order.index(k)] for k in range(10)]
        made = Explained(made.pieces, made.columns, items, 0)
        several = odds_of(made)
        return searched(Explained(made.pieces, made.columns, [x for h in several for x in h.items], 0), several)

    before = smallest(told)
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, constant, factor)
            assert bool(smallest(told) < 0.99 * before) is (factor > 1)
            assert told(before / 1.005) is (factor > 1)
            assert told(1.005 * before) is (factor > 1)


@pytest.mark.parametrize("spread", [0.08, 300.0])
def test_the_smallest_that_is_named_hangs_on_the_sizes(monkeypatch, spread):
    """A small effect needs sizes as small, a large one pays for those beyond it."""

    def named(size):
        made = planted(size)
        items = [Item(x.index, np.array([spread]), x.positive) for x in made.items]
        made = Explained(made.pieces, made.columns, items, 0)
        return searched(made, hypotheses(items, 0.05))

    before = smallest(named)
    found = []
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "SIZES", factor)
            found.append(smallest(named))
    assert not np.isclose(found[0], before, rtol=2e-3)
    assert not np.isclose(found[1], before, rtol=2e-3)


def test_how_far_a_whole_law_may_be_from_its_own_size(monkeypatch):
    """Of one that does 0.8 of what it should, in noise that tells: named, and with half the deviation not."""
    made = planted(1.0)
    own = made.pieces[0][0]

    def gain(size):
        made.pieces[0][0] = Channel(size * own.residual * 2, own.covariance, own.index, own.columns)
        x = Item(made.items[0].index, 2 * np.ones(1), np.ones(1, bool), True)
        on = Projected(Evidence(made.pieces, made.columns, [x], 0), (0,))
        return Members(on).gains()[0, 0]

    def farthest():
        """The largest amplitude beyond one at which a law is likelier than nothing by e⁴⁰."""
        return max(s for s in np.linspace(1.0, 3.0, 401) if gain(s) - 0.5 * 200 * (2 * s) ** 2 > -15)

    before = farthest()
    found = []
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "WHOLE", factor)
            found.append(farthest())
    assert found[0] < before - 0.05
    assert found[1] > before + 0.05


def confirmed(monkeypatch, sure: float) -> bool:
    name: Any = SimpleNamespace(placed=Placed(get_effect("sensor_bias"), "tau.joint1"))
    monkeypatch.setattr(confirming, "foretold", lambda *_: None)
    monkeypatch.setattr(confirming, "_without", lambda model, _: model)
    monkeypatch.setattr(confirming, "_missed", lambda *_: confirming.Missed(sure, 1.0, (0.1, 0.2), cast(Any, None)))
    found: Any = SimpleNamespace(names=(name,), model=None, fit=None)
    return bool(confirming.confirm(found, [], [], {}, lambda _: None).names)


def test_a_name_is_confirmed_from_one_standard_error_on(monkeypatch):
    assert [confirmed(monkeypatch, x) for x in (0.6, 0.99, 1.01, 1.9)] == [False, False, True, True]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "GATE", factor)
            assert confirmed(patch, 0.6) is (factor < 1)
            assert confirmed(patch, 1.9) is (factor < 1)


def test_blocks_of_time(monkeypatch):
    run: Any = SimpleNamespace(motion=SimpleNamespace(band=50.0))
    x = np.ones(3000)
    assert len(confirming.blocks(x, run)) == 20
    for factor, count in zip(FACTORS, (40, 10), strict=True):
        with monkeypatch.context() as patch:
            move(patch, "BLOCK", factor)
            assert len(confirming.blocks(x, run)) == count


def rivals(share: float, cosine: float) -> list[bool]:
    """Can a rival of this share be told apart, whose column stands at this cosine to the name's?"""
    made = planted(1.0)
    (x,) = made.columns.parts[0, 0]
    x[:, 1] = cosine * x[:, 0] + np.sqrt(1 - cosine**2) * x[:, 2]
    labels = [SimpleNamespace(amplitudes=[0]), SimpleNamespace(amplitudes=[0])]
    items = [Item(i.index, i.spread, i.positive, False, y) for i, y in zip(made.items[:2], labels, strict=True)]
    made = Explained(made.pieces, made.columns, items, 0)
    several = [Hypothesis(f"h{k}", True, (i,), -3.0 * k, f"h{k}") for k, i in enumerate(items)]
    run = Search(Projected(made.evidence(), (0,)), several)
    (slot,) = run.answer()
    object.__setattr__(slot, "shares", np.array([1 - share, share, 0.0]))
    return [r.separable for r in rounds._rivals(run, slot, np.ones(1))]


def test_a_rival_with_a_tenth_of_the_shares_is_not_told_apart(monkeypatch):
    assert [rivals(x, 0.3) for x in (0.06, 0.099, 0.101, 0.19)] == [[True], [True], [False], [False]]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "CLASS", factor)
            assert rivals(0.06, 0.3) == [factor > 1]
            assert rivals(0.19, 0.3) == [factor > 1]


def test_what_adds_the_same_is_alike(monkeypatch):
    """A cosine beyond twice 0.98 there is none: then nothing is alike, and at half of it too much."""
    assert [rivals(0.01, x) for x in (0.6, 0.979, 0.981, 1.0)] == [[True], [True], [False], [False]]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "ALIKE", factor)
            assert rivals(0.01, 0.6) == [factor > 1]
            assert rivals(0.01, 0.99) == [factor > 1]


@pytest.mark.parametrize("constant", ["STICKS", "SETTLES"])
def test_where_a_joint_sticks_and_where_its_friction_settles(monkeypatch, constant):
    """Of a peak of 2: below 0.08 and 0.2; of a travel of 100, for 0.5 and 1.2 after it stood."""
    edge, after, at = {"STICKS": (0.08, 50, 0), "SETTLES": (0.2, 120, None)}[constant]
    speeds = [1.0, 1.9 * edge, 1.01 * edge, 0.99 * edge, 0.6 * edge, 0.4 * edge, 1.0]
    stood = np.concatenate([np.zeros(5), np.ones(400)])

    def told():
        zone = getattr(rest, constant) if at is None else getattr(rest, constant)[at]
        return len(near_rest(speeds, Zone(zone.speed, 0.0))), len(near_rest(stood, zone, 100.0)) - 5

    assert told() == (3, pytest.approx(after, abs=1))
    for factor, slow in zip(FACTORS, (1, 5), strict=True):
        with monkeypatch.context() as patch:
            move(patch, constant, factor)
            assert told() == (slow, pytest.approx(factor * after, abs=1))


def level(rest_torque: float) -> float:
    """What a joint of RMS torque 10 is said to hold, with this much left over at rest."""
    assembly: Any = SimpleNamespace(tree=SimpleNamespace(joints=[SimpleNamespace(name="joint1")]), placed=(), slots=())
    train: Any = [SimpleNamespace(motion=SimpleNamespace(to_band=lambda x: x, qd=np.zeros((20, 1))))]
    return arm._level(assembly, np.zeros(0), train, [np.full((20, 1), rest_torque)], 0, 1.0, 10.0)


def test_a_joint_holds_something_at_least(monkeypatch):
    assert [level(x) for x in (0.1, 0.5)] == pytest.approx([0.3, 0.5])
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "LEAST_LEVEL", factor)
            assert level(0.1) == pytest.approx(0.3 * factor)


def spread(monkeypatch, theta=2.0, shape=False) -> float:
    """Prior deviation of a parameter that makes a tenth of its channel's torque a unit."""
    found: Any = SimpleNamespace(theta=np.array([theta]), assembly=None)
    monkeypatch.setattr(beside, "_shapes", lambda _: np.array([shape]))
    baseline = [[(np.zeros(1, int), np.ones((5, 1)))]]
    return float(beside._spread(found, baseline, np.array([10.0]))[0])


def test_how_far_the_baseline_may_move(monkeypatch):
    """Half of its own 2, and 0.2 of the channel's torque, which is 2; a shape by 0.3 of itself at most."""
    assert spread(monkeypatch) == pytest.approx(1 + 2)
    assert spread(monkeypatch, shape=True) == pytest.approx(0.6)
    moved = {"BASELINE": (2.0, 5.0), "BASELINE_OWN": (2.5, 4.0)}
    for constant, wanted in moved.items():
        for factor, value in zip(FACTORS, wanted, strict=True):
            with monkeypatch.context() as patch:
                move(patch, constant, factor)
                assert spread(patch) == pytest.approx(value)
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "BASELINE_SHAPE", factor)
            assert spread(patch, shape=True) == pytest.approx(0.6 * factor)


def small(own_share: float) -> dict[tuple[int, str], float]:
    """Sizes of the small curves beside a friction law that makes this share of the channel's torque."""
    placed = Placed(get_effect("viscous_friction"), "joint1")
    assembly: Any = SimpleNamespace(
        placed=(placed,), index_of=lambda _: [0], joint_of=lambda _: 0, slots=[
            SimpleNamespace(effect="viscous_friction", at="joint1", name="coefficient")])  # fmt: skip
    found: Any = SimpleNamespace(theta=np.array([own_share]), assembly=assembly)
    return beside._small(found, [[(np.zeros(1, int), 10 * np.ones((5, 1)))]], np.array([10.0]))


def test_small_curves_stand_beside_everything(monkeypatch):
    """A share of the torque; and one of a law's share over what it runs over, here speed, both squared and added."""
    everywhere, of_law = deciding.DISCREPANCY, 0.4 * deciding.LAW_ERROR
    sizes = small(0.4)
    assert sizes[0, "position"] == pytest.approx(everywhere)
    assert sizes[0, "speed by direction"] == pytest.approx(np.hypot(everywhere, of_law))
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "DISCREPANCY", factor)
            assert small(0.4)[0, "position"] == pytest.approx(factor * everywhere)
        with monkeypatch.context() as patch:
            move(patch, "LAW_ERROR", factor)
            assert small(0.4)[0, "speed by direction"] == pytest.approx(np.hypot(everywhere, factor * of_law))


def test_a_level_that_wanders_must_show(monkeypatch):
    """The stronger its prior, the less of a weak wander is believed; its times are those that are tried."""
    rng, n, step = np.random.default_rng(7), 1200, 1 / 40
    decay = np.exp(-step / 8.0)
    walk = np.zeros(n)
    for k in range(1, n):
        walk[k] = decay * walk[k - 1] + np.sqrt(1 - decay**2) * rng.normal()
    nothing = np.zeros(n)
    run = Run(step, (slice(0, n),), nothing, (nothing,), nothing, 0.0)
    t = step * np.arange(n)
    x = np.stack([np.sin(2 * np.pi * 0.21 * t), np.cos(2 * np.pi * 0.34 * t)], 1) * np.sqrt(2)

    def wander():
        noise = learn([0.25 * walk + 0.5 * rng_noise], [x], [run])
        return noise.wander, noise.wander_time

    rng_noise = rng.normal(size=n)
    level, time = wander()
    assert level > 0
    assert time in deciding.WANDER_TIMES
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "WANDER_PRIOR", factor)
            found = wander()[0]
            assert (found < 0.995 * level) if factor > 1 else (found > 1.005 * level)
        with monkeypatch.context() as patch:
            move(patch, "WANDER_TIMES", factor)
            assert wander() != (level, time)


def test_an_effect_that_is_at_one_joint_is_likelier_at_another(monkeypatch):
    """The smallest viscous friction that is told at a second of five joints, beside one that is plain."""

    def told(size):
        made = planted(1.0)
        (x,) = made.columns.parts[0, 0]
        own = made.pieces[0][0]
        made.pieces[0][0] = Channel(x[:, 0] + size * x[:, 1], own.covariance, own.index, own.columns)
        several = odds_of(made)
        slots = Search(Projected(made.evidence(), (0,)), several).answer()
        return 1 in {s.taken.hypothesis for s in slots}

    before = smallest(told)
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "ELSEWHERE", factor)
            assert bool(smallest(told) < 0.97 * before) is (factor > 1)
            assert bool(smallest(told) > 1.03 * before) is (factor < 1)


def becomes(alike: float) -> bool:
    """Does a curve become the name whose law can add this share of what it adds?"""
    made = planted(1.0)
    (x,) = made.columns.parts[0, 0]
    x[:, 1] = np.sqrt(alike) * x[:, 0] + np.sqrt(1 - alike) * x[:, 2]
    labels = [SimpleNamespace(amplitudes=[0])] * 2
    items = [Item(i.index, i.spread, i.positive, False, y) for i, y in zip(made.items[:2], labels, strict=True)]
    made = Explained(made.pieces, made.columns, items, 0)
    several = [Hypothesis("curve", False, (items[0],), -1.0), Hypothesis("name", True, (items[1],), -12.0)]
    run = Search(Projected(made.evidence(), (0,)), several)
    slots = run.answer()
    assert [s.taken.hypothesis for s in slots] == [0]
    return rounds._as_names(run, slots)[0].taken.hypothesis == 1


def test_a_curve_becomes_the_name_that_it_nearly_is(monkeypatch):
    assert [becomes(x) for x in (0.5, 0.74, 0.76, 0.9)] == [False, False, True, True]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "NEARLY", factor)
            assert becomes(0.5) is (factor < 1)
            assert becomes(0.9) is (factor < 1)


def test_a_payload_is_named_beyond_what_masses_are_known_to(monkeypatch):
    """Smaller ones are the masses' tolerance: the smallest that is named goes with how wide that may be."""

    def named(size):
        made = planted(1.0)
        (x,) = made.columns.parts[0, 0]
        x *= 1000
        own = made.pieces[0][0]
        made.pieces[0][0] = Channel(size * x[:, 0], own.covariance, np.zeros(1, int), x[:, :1])
        made = Explained(made.pieces, made.columns, made.items[:1], 1)
        payload = Hypothesis("payload", True, (made.items[0],), -6.0)
        masses = Beside([], 1, slice(0, 1), [])
        weighed: Any = SimpleNamespace(beside=masses, evidence=made.evidence(), pool=(payload,), noises=())
        return bool(tolerant.searched(weighed, (0,), (), range(len(weighed.noises)))[2])

    before = smallest(named)
    assert before > deciding.TOLERANCES[-1]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "TOLERANCES", factor)
            assert smallest(named) == pytest.approx(factor * before, rel=0.25)


def searching(monkeypatch, rounds_with_news: int) -> tuple[int, set[float]]:
    """How many names a search has of which every round finds another, and the shares of motion that may be driven."""
    shares = set()

    def planned(*_, driven, **__):
        shares.add(driven)
        return [None]

    slot = SimpleNamespace(gain=10.0, taken=SimpleNamespace(hypothesis=0))
    made = SimpleNamespace(members=lambda _: SimpleNamespace(value=20.0), scan=lambda _: SimpleNamespace(odds=[1.0]))
    weighed = SimpleNamespace(noises=(), pool=[SimpleNamespace(named=True, label=Placed(get_effect("backlash"), "a"))])
    left = iter([[slot]] * rounds_with_news + [[]] * 99)
    model: Any = SimpleNamespace(with_effects=lambda *_: model)
    stubs: dict[str, Any] = {
        "assemble": lambda *_: None, "fit": lambda *_, **__: None, "fitted": lambda *_: None, "planned": planned,
        "refitted": lambda *_: None, "weigh": lambda *_: weighed,
        "searched": lambda *_: (weighed, made, next(left), 0.0),
        "_trials": lambda *_: (), "_as_names": lambda _, slots: slots, "_error_of_laws": lambda *_: [0.0],
        "_reached": lambda *_: [0],
        "_name": lambda *_: (SimpleNamespace(placed=weighed.pool[0].label, channels=(0,)), {}),
    }  # fmt: skip
    for name, stub in stubs.items():
        monkeypatch.setattr(rounds, name, stub)
    return len(rounds.search(model, None, {}, [], []).names), shares


def test_a_search_goes_on_for_so_many_rounds(monkeypatch):
    """Where every round finds something; with fewer it ends by itself."""
    assert [searching(monkeypatch, n)[0] for n in (1, 3, 4, 9)] == [1, 3, 4, 4]
    for factor, names in zip(FACTORS, (2, 8), strict=True):
        with monkeypatch.context() as patch:
            move(patch, "ROUNDS", factor)
            assert searching(patch, 9)[0] == names


def test_how_much_of_a_motion_may_be_driven_is_what_the_search_asks_for(monkeypatch):
    """What it then does to the band of a joint is in test_closed_loop.py: it goes with its fifth root."""
    assert searching(monkeypatch, 2)[1] == {deciding.DRIVEN}
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "DRIVEN", factor)
            assert searching(patch, 2)[1] == {factor * 0.01}


def attempts(monkeypatch) -> float:
    """How well the best attempt foretells, where each foretells better than the last and none is whole."""
    density = iter(range(99))
    name = SimpleNamespace(placed=SimpleNamespace(key="a"))
    monkeypatch.setattr(deciding_all, "search", lambda *_, **__: None)
    monkeypatch.setattr(deciding_all, "left_over", lambda *_: None)
    monkeypatch.setattr(
        deciding_all,
        "confirm",
        lambda *_: SimpleNamespace(rejected=(name,), found=None, foretold=SimpleNamespace(density=next(density))),
    )
    model: Any = None
    return deciding_all.decide(model, None, {}, [], []).best.foretold.density


def test_what_was_not_confirmed_is_looked_for_again_twice(monkeypatch):
    assert attempts(monkeypatch) == 2
    for factor, best in zip(FACTORS, (1, 4), strict=True):
        with monkeypatch.context() as patch:
            move(patch, "SECOND_CHOICES", factor)
            assert attempts(patch) == best


@pytest.mark.parametrize(("constant", "told"), [("BURST_LOUD", 7.0), ("BURST_SHARE", 7.0)])
def test_how_loud_and_how_much_makes_bursts(monkeypatch, constant, told):
    """One window of 5 beside eleven of 1 is none: 2 of 16 beyond three times the median; of 7 it is: 4 of 18."""

    def heard(loud):
        return bursts([windows(*11 * [1], loud)]) is not None

    assert [heard(5), heard(told)] == [False, True]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, constant, factor)
            assert heard(5) is (factor < 1)
            assert heard(told) is (factor < 1)


def test_how_long_the_windows_of_bursts_are(monkeypatch):
    """Twelve are needed: of eleven half seconds nothing is said, of twelve it is; of as many halves of them, or so
    many whole seconds, otherwise."""

    def heard(count):
        return bursts([windows(*(count - 1) * [1], 16)]) is not None

    assert [heard(11), heard(12), heard(23)] == [False, True, True]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "BURST_WINDOW", factor)
            assert heard(11) is (factor < 1)
            assert heard(23) is (factor < 1)


def shaped(monkeypatch, off: float, bent: float, curve: bool) -> float:
    """Log Bayes factor of a law at the middle one of three shapes, which is off by so many steps, and bent by so much.

    Between shapes the law changes by one of ten columns, and it is bent by another, over which there may be a curve.
    """
    made = planted(1.0)
    (x,) = made.columns.parts[0, 0]
    placed = Placed(get_effect("stribeck_friction"), "joint1")
    grid = [Variant(placed, np.array([1.0, s]), np.zeros(1, int), np.zeros(1), np.ones(1)) for s in (1.0, 2.0, 3.0)]
    laws = {v.parameters[1]: x[:, [0]] + (v.parameters[1] - 2) * x[:, [1]] for v in grid}
    monkeypatch.setattr(hypothesising, "_grid", lambda *_: (grid, not curve))
    monkeypatch.setattr(hypothesising, "_made", lambda _, v: {0: [laws[v.parameters[1]]]})
    columns = Columns([len(x)])
    over = Item(columns.add({0: [x[:, [2]]]}), np.ones(1), np.zeros(1, bool))
    words = hypothesising.coordinate(placed.effect) or ""
    along: Any = SimpleNamespace(n_train=1, scale=np.ones(1), assembly=SimpleNamespace(joint_of=lambda _: 0))
    items = hypothesising._items(along, placed, {(0, words): over} if curve else {}, columns)
    own = made.pieces[0][0]
    residual = 0.3 * 10 * (x[:, 0] + off * x[:, 1] + bent * x[:, 2])
    channel = Channel(residual, own.covariance, own.index, own.columns)
    gains = Members(Projected(Evidence([[channel]], columns, items, 0), (0,))).gains()
    middle = [k for k, item in enumerate(items) if item.label.parameters[1] == 2.0]
    return float(gains[middle].max())


@pytest.mark.parametrize(("constant", "off", "bent"), [("SLOPE", 0.6, 0.0), ("BENDS", 0.0, 1.2)])
def test_how_far_a_law_may_be_from_a_shape_that_is_tried(monkeypatch, constant, off, bent):
    """One that is far from it is believed more with more freedom, one that is just that shape with less."""
    curve = constant == "BENDS"

    def believed():
        return shaped(monkeypatch, off, bent, curve), shaped(monkeypatch, 0.0, 0.0, curve)

    far, near = believed()
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, constant, factor)
            other = believed()
        assert (other[0] > far + 0.3) if factor > 1 else (other[0] < far - 0.3), f"{constant} times {factor}"
        assert (other[1] < near - 0.1) if factor > 1 else (other[1] > near + 0.1), f"{constant} times {factor}"


def test_no_number_is_without_a_test():
    """Every one of them is named in this file, but for those that stand in a table of their own above."""
    own = Path(__file__).read_text(encoding="utf-8")
    assert [n for n in vars(deciding) if n.isupper() and f'"{n}"' not in own] == []
