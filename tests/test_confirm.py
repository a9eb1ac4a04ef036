"""The order in which a held-out recording rules effects out: the one missed least goes first, with few trials."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from snarelab.identification import confirm as module
from snarelab.identification.confirm import SURE, _known, _Missed, confirm

N = 6


def eager(rise) -> set[int]:
    """What is left when every effect is tried again after each that went."""
    left = set(range(N))
    while left:
        weakest = min(left, key=lambda k: rise(k, left))
        if rise(weakest, left) > 1:
            break
        left.remove(weakest)
    return left


@pytest.mark.parametrize("seed", range(20))
def test_trying_few_again_rules_out_what_trying_all_again_would(seed, monkeypatch):
    """Effects that stand in for each other are missed more once the other is gone: then the least missed is found
    without trying all."""
    rng = np.random.default_rng(seed)
    alone, stands_in = rng.uniform(0.0, 1.3, N), rng.uniform(0.0, 0.7, (N, N))
    tried = []

    def rise(key: int, left: set[int]) -> float:
        return float(alone[key] + sum(stands_in[key, k] for k in range(N) if k not in left))

    def missed(taken: Any, final: Any, *_: Any) -> _Missed:
        tried.append(taken.judged.placed.key)
        return _Missed(rise(tried[-1], final), (0.0, 1.0), final - {tried[-1]})

    monkeypatch.setattr(module, "_missed", missed)
    taken = tuple(SimpleNamespace(judged=SimpleNamespace(placed=SimpleNamespace(key=k))) for k in range(N))
    found: Any = SimpleNamespace(fit=frozenset(range(N)), taken=taken)
    done = confirm(found, [], [], lambda _: None)
    left = {t.judged.placed.key for t in done.confirmed}
    assert left == eager(rise) == done.final
    assert {t.judged.placed.key for t in done.rejected} == set(range(N)) - left
    assert set(done.trials) == left
    rounds = len(done.rejected)
    assert len(tried) <= N + sum(range(N - rounds, N))  # no more than trying all again


def test_of_two_twins_one_stays(monkeypatch):
    def missed(taken: Any, final: Any, *_: Any) -> _Missed:
        key = taken.judged.placed.key
        return _Missed(0.2 if len(final) == 2 else 5.0, (0.1, 0.4), final - {key})

    monkeypatch.setattr(module, "_missed", missed)
    taken = tuple(SimpleNamespace(judged=SimpleNamespace(placed=SimpleNamespace(key=k))) for k in "ab")
    found: Any = SimpleNamespace(fit=frozenset("ab"), taken=taken)
    done = confirm(found, [], [], lambda _: None)
    assert len(done.confirmed) == len(done.rejected) == 1
    assert done.trials == {done.confirmed[0].judged.placed.key: (0.1, 0.4)}


@pytest.mark.parametrize(("deviations", "known"), [((0.3, 0.9 * SURE), False), ((0.3, 1.1 * SURE), True), ((), True)])
def test_a_name_needs_one_amplitude_that_is_known_to_be_other_than_zero(deviations, known):
    """The third parameter is a shape: a travel or a speed is never zero, and says nothing. With no amplitude, the law's
    shape is all there is to judge."""
    names = ("first", "second", "shape")
    slots = [SimpleNamespace(name="of another effect"), *(SimpleNamespace(name=n) for n in names)]
    final: Any = SimpleNamespace(
        assembly=SimpleNamespace(index_of=lambda placed: [1, 2, 3], slots=slots),
        theta=np.array([9.0, *(deviations or (0.0, 0.0)), 9.0]),
        std=np.ones(4),
    )
    effect = SimpleNamespace(parameters=[SimpleNamespace(name=n) for n in names])
    variant = SimpleNamespace(amplitudes=range(len(deviations)))
    taken: Any = SimpleNamespace(judged=SimpleNamespace(placed=SimpleNamespace(effect=effect), variant=variant))
    assert _known(final, taken) is known


@pytest.mark.parametrize(
    ("flags", "motion", "everywhere", "floor", "kept"),
    [
        ({}, 1.08, 1.003, 1.0, True),
        # What is missed in motion and leaves the whole recording worse improves nothing.
        ({}, 1.08, 0.997, 1.0, False),
        ({"exceeds_at_rest": True}, 1.08, 0.997, 1.0, True),
        ({"at_rest": True}, 1.0, 1.08, 1.0, True),
        # The fit with it keeps samples near rest, the one without does not: what differs in motion alone is the fits.
        ({"at_rest": True, "remembers": True}, 1.08, 1.003, 1.0, False),
        ({"remembers": True}, 1.08, 1.08, 1.0, True),
        # Energy 1.08 before and 1 after: of what stands above 0.98 in motion it takes 4/5, above 0.96 only 2/3.
        ({"remembers": True}, 1.0, 1.08, 0.98, True),
        ({"remembers": True}, 1.0, 1.08, 0.96, False),
    ],
)
def test_a_name_is_missed_in_motion_or_where_its_law_holds_and_over_all_samples(
    flags, motion, everywhere, floor, kept, monkeypatch
):
    """Energies held out: with the effect 1 over all samples and ``floor`` in motion, without it so many times that."""
    energy = {
        ("final", "all"): 1.0,
        ("rest", "all"): everywhere,
        ("final", "since"): 1.0,
        ("rest", "since"): everywhere,
        ("final", "motion"): floor,
        ("rest", "motion"): floor * motion,
        ("without", "all"): 2.0,  # the same fit with the effect struck out
        ("final", "fitted"): floor,  # where a joint creeps, as in motion
        ("rest", "fitted"): floor * motion,
    }

    def channel_rms(assembly, samples, theta):
        which = "without" if theta == "carried" else assembly
        return np.sqrt([energy[which, samples]]), np.ones(1)

    effect = SimpleNamespace(**{"at_rest": False, "exceeds_at_rest": False, "remembers": False, **flags})
    judged = SimpleNamespace(channels=(0,), placed=SimpleNamespace(effect=effect))
    final: Any = SimpleNamespace(assembly="final", theta="final", sigma=np.ones(1))
    rest = SimpleNamespace(assembly="rest", theta="rest")
    for name, stand_in in {
        "channel_rms": channel_rms,
        "without": lambda *_: "rest",
        "carry": lambda *_: "carried",
        "fitted": lambda *_: "fitted",
        "fit": lambda *_, **__: rest,
        "_known": lambda *_: True,
    }.items():
        monkeypatch.setattr(module, name, stand_in)
    taken: Any = SimpleNamespace(judged=judged)
    samples: Any = ("train", "all", "since", "motion")
    assert (module._missed(taken, final, *samples).rise > 1) is kept


def missed(monkeypatch, rms, *, flags=None, known=True, sigma=(1.0, 1.0), channels=(0, 1)):
    """An effect on these channels, taken out of a fit; ``rms`` by fit and samples, of a measured 2 and 4 (RMS)."""

    def channel_rms(assembly, samples, theta):
        return np.array(rms["carried" if theta == "carried" else assembly, samples]), np.array([2.0, 4.0])

    effect = SimpleNamespace(**{"at_rest": False, "exceeds_at_rest": False, "remembers": False, **(flags or {})})
    judged = SimpleNamespace(channels=channels, placed=SimpleNamespace(effect=effect))
    rest = SimpleNamespace(assembly="rest", theta="rest")
    for name, stand_in in {
        "channel_rms": channel_rms,
        "without": lambda *_: "rest",
        "carry": lambda *_: "carried",
        "fitted": lambda _assembly, samples: "creeping" if samples == "all" else "fitted",
        "fit": lambda *_, **__: rest,
        "_known": lambda *_: known,
    }.items():
        monkeypatch.setattr(module, name, stand_in)
    samples: Any = ("train", "all", "since", "motion")
    return module._missed(*cast(Any, (SimpleNamespace(judged=judged), SimpleNamespace(
        assembly="final", theta="final", sigma=np.array(sigma)), *samples)))  # fmt: skip


RMS = {
    ("final", "all"): [1.0, 1.0],
    ("rest", "all"): [1.2, 1.5],  # relative to 2 and 4 the first channel loses 0.1, the second 0.125
    ("carried", "all"): [3.0, 3.0],
    ("final", "since"): [1.0, 1.0],
    ("rest", "since"): [1.2, 1.5],
    ("final", "motion"): [1.0, 1.0],
    ("rest", "motion"): [1.1, 1.0],
    ("final", "creeping"): [1.0, 1.0],
    ("rest", "creeping"): [1.3, 1.0],
}


@pytest.mark.parametrize(
    ("flags", "share"),
    [
        ({}, 2.21 / 2 - 1),  # in motion: 1.1² + 1
        ({"at_rest": True}, 3.69 / 2 - 1),  # over all samples: 1.2² + 1.5²
        ({"exceeds_at_rest": True}, 3.69 / 2 - 1),
    ],
)
def test_the_rise_is_the_share_by_which_the_energy_grows_over_a_twentieth(monkeypatch, flags, share):
    found = missed(monkeypatch, RMS, flags=flags)
    assert found.rise == pytest.approx(share / 0.05, rel=1e-9)
    assert found.trial == pytest.approx((0.25, 0.375))  # the second channel misses it most


def test_samples_that_creep_count_for_what_exceeds_at_rest_alone(monkeypatch):
    """Its own samples show 1.3² + 1 of 2, where all of them show less."""
    rms = RMS | {("rest", "all"): [1.0, 1.1]}
    assert missed(monkeypatch, rms, flags={"exceeds_at_rest": True}).rise == pytest.approx((2.69 / 2 - 1) / 0.05)
    assert missed(monkeypatch, rms, flags={"at_rest": True}).rise == pytest.approx((2.21 / 2 - 1) / 0.05)


def test_channels_are_weighted_as_the_fit_weights_them(monkeypatch):
    """With a sigma of 0.5 the first one's squares count four times: (4 · 1.21 + 1)/(4 + 1) of the energy."""
    assert missed(monkeypatch, RMS, sigma=(0.5, 1.0)).rise == pytest.approx((5.84 / 5 - 1) / 0.05)
    assert missed(monkeypatch, RMS, channels=(0,)).rise == pytest.approx(0.21 / 0.05)
    assert missed(monkeypatch, RMS, channels=(0,)).trial == pytest.approx((0.5, 0.6))


@pytest.mark.parametrize(("change", "adds"), [(0.99e-3, False), (1.01e-3, True)])
def test_what_moves_a_millionth_of_the_energy_or_less_adds_nothing(monkeypatch, change, adds):
    """One channel of 1, moved by a thousandth: a millionth of its energy."""
    found = missed(monkeypatch, RMS | {("carried", "all"): [1.0 + change, 1.0]}, channels=(0,))
    assert found.rise == pytest.approx(0.21 / 0.05 if adds else 0.0)
    assert found.trial == pytest.approx((0.5, 0.6))


@pytest.mark.parametrize(("since", "missed_"), [((1.0, 1.0), 0.0), ((1.01, 1.0), 0.105 / 0.05)])
def test_the_recording_must_be_told_better_from_its_first_motion_on(monkeypatch, since, missed_):
    """What is held before it is told better without the effect, and says nothing."""
    rms = RMS | {("rest", "all"): [0.8, 0.8], ("rest", "since"): list(since)}
    assert missed(monkeypatch, rms).rise == pytest.approx(missed_)


def test_an_effect_whose_size_is_not_known_is_not_missed(monkeypatch):
    found = missed(monkeypatch, RMS, known=False)
    assert found.rise == 0.0
    assert found.fit.assembly == "rest"


@pytest.mark.parametrize(("rise", "stays"), [(1.0, False), (1.001, True)])
def test_an_effect_stays_if_it_is_missed_by_more_than_the_bar(rise, stays, monkeypatch):
    monkeypatch.setattr(module, "_missed", lambda *_: _Missed(rise, (0.1, 0.2), cast(Any, "without it")))
    one = SimpleNamespace(judged=SimpleNamespace(placed=SimpleNamespace(key="one")))
    told = []
    found: Any = SimpleNamespace(fit="with it", taken=(one,))
    done = confirm(found, [], [], told.append)
    assert (len(done.confirmed), len(done.rejected)) == ((1, 0) if stays else (0, 1))
    assert done.final == ("with it" if stays else "without it")
    assert done.trials == ({"one": (0.1, 0.2)} if stays else {})
    assert len(told) == (1 if stays else 2)
