"""A capture's answer in numbers: estimates, steps, limits, traces and findings from fits of a few numbers."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from captures_by_hand import CLEARANCE, FRICTION, PRETENSION, UMBILICAL, along, capture, fit_of, track

from snarelab.identification.evidence.rival import RivalOdds
from snarelab.identification.snare import answer as module
from snarelab.identification.snare.answer import (
    _finding,
    _fits,
    _limits,
    _moved,
    _relative,
    _sentence,
    _steps,
    _traces,
    _unexplained,
    estimates,
    report_on,
)
from snarelab.identification.snare.search import CaptureNaming, CaptureSelection
from snarelab.identification.snare.trials import CaptureTrial
from snarelab.models.model import PlacedEffect

MODEL: Any = SimpleNamespace(name="capture")


@pytest.fixture(autouse=True)
def _nothing_there(monkeypatch):
    monkeypatch.setattr(module, "absent", lambda _model, _placed: 0.0)
    monkeypatch.setattr(module, "locate_capture", lambda *_: ())


def motion(x):
    """The target goes from 0 to so many metres along x, at 2 N on the end effector, then 1 N."""
    push = np.repeat([[2.0, 0.0, 0.0], [1.0, 0.0, 0.0]], 5, axis=0)
    return track(along(0.0, x), effector=push)


OWN = capture(motion(0.4), zero=5.0, noise=0.0)
LEFT = {"position": np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])}


def simulated(x, placed=(), handles=(), columns=(), likelihood=0.0):
    """A fit whose simulation goes to x, and whose handles change the residual of the last x so much."""
    slopes = tuple(({"position": np.array([[0.0, 0.0, 0.0], [c, 0.0, 0.0]])},) for c in columns)
    return fit_of(placed, handles, likelihood, [LEFT], [motion(x)], slopes)


def searched(first, last, named=(), **more):
    given = {"held_first": first, "held_last": last, "opening": (), "rejected": (), "bar": 5.0, **more}
    return CaptureSelection(tuple(named), first, last, **given)


def named(placed, fit, before, after, *, explained=0.6, margin=0.99, rivals=()):
    return CaptureNaming(CaptureTrial(placed, fit, 30.0, explained), margin, tuple(rivals), before, after)


@pytest.mark.parametrize(
    ("placed", "x", "bound"),
    [
        (FRICTION, 0.4, False),
        (FRICTION, 0.0, True),
        (FRICTION, 1.5, True),
        (FRICTION, 1e-6, False),
        (FRICTION, 1.5 - 1e-6, False),
        (FRICTION, 2e-8, True),  # a millionth of the handle's difference of 0.03
    ],
)
def test_an_estimate_has_its_spread_and_says_where_it_stands_at_a_bound(placed, x, bound):
    """One number of six moves: variance v = 4 (0.1²/6 + f²), spread sqrt(v)/column."""
    found = estimates([OWN], simulated(0.4, [placed], [x], [2.0]))
    (one,) = found[placed.key].values()
    v = 4 * (0.01 / 6 + 1.5e-4**2)
    assert one.value == pytest.approx(x)
    assert one.std == pytest.approx(np.sqrt(v) / 2, rel=1e-9)
    assert one.at_bound is bound
    assert (list(found[placed.key]), one.unit) == (["coefficient"], "1")


def test_what_is_left_is_the_mean_of_motions_and_forces_shares():
    """Motion 0.4 m at the end, 0.1 m missed: 1/16 of its energy; forces are met: the root of 1/32."""
    assert _relative([OWN], simulated(0.3)) == pytest.approx(np.sqrt(1 / 32))
    assert _relative([OWN], simulated(0.4)) == pytest.approx(0.0, abs=1e-12)


def test_steps_tell_what_each_name_left_on_both_sets():
    """0.2 m are missed first, then 0.1 m and 0.04 m: half of the shares' mean, 1/4, 1/16 and 1/100, under a root."""
    middle, last = simulated(0.3, [FRICTION], [0.2], [1.0]), simulated(0.36, [FRICTION, PRETENSION], [0.2, 9.0])
    found = searched(
        simulated(0.2),
        last,
        [
            named(FRICTION, middle, simulated(0.2), simulated(0.3)),
            named(PRETENSION, last, simulated(0.3), simulated(0.36)),
        ],
    )
    first, second, third = _steps(found, [OWN], [OWN])
    assert [s.label for s in (first, second, third)] == [
        "model as given",
        "+ contact_friction at pin",
        "+ cable_pretension at cables",
    ]
    for step, share in ((first, 1 / 4), (second, 1 / 16), (third, 1 / 100)):
        assert (step.train, step.holdout) == pytest.approx((np.sqrt(share / 2),) * 2)


def test_misfits_stand_by_channel_with_the_noise_of_a_quarters_mean():
    own = capture(motion(0.4), noise=0.02)
    found = _fits(
        searched(simulated(0.2), simulated(0.3), held_first=simulated(0.1), held_last=simulated(0.38)), [own], [own]
    )
    assert [f.channel for f in found] == [f"pos.target.{a}" for a in "xyz"] + [f"force.wrist.{a}" for a in "xyz"]
    x = found[0]
    # One of two numbers is off: the root of a half of it; motion is 0.4 m in one of the two.
    assert (x.train.rms_before, x.train.rms_after) == pytest.approx((0.2 / 2**0.5, 0.1 / 2**0.5))
    assert (x.train.relative_before, x.train.relative_after) == pytest.approx((0.5, 0.25))
    assert (x.holdout.relative_before, x.holdout.relative_after) == pytest.approx((0.75, 0.05))
    assert all(f.noise_floor == pytest.approx(0.02 / 5**0.5) for f in found)
    assert [f.unit for f in found] == ["m"] * 3 + ["N"] * 3


def test_a_channel_that_only_one_of_the_sets_has_is_not_shown():
    bare = capture(track(along(0.0, 0.4)))
    alone = fit_of([], [], 0.0, [LEFT], [track(along(0.0, 0.3))])
    found = _fits(searched(simulated(0.2), simulated(0.3), held_first=alone, held_last=alone), [OWN], [bare])
    assert [f.channel for f in found] == [f"pos.target.{a}" for a in "xyz"]


def test_traces_hold_measured_and_modelled_values_of_each_capture():
    first, last = simulated(0.1), simulated(0.3)
    found = _traces(searched(first, last), [OWN], [capture(motion(0.4), path="data/b.csv")])
    assert [(t.recording, t.role) for t in found[::6]] == [("a.csv", "train"), ("b.csv", "holdout")]
    x, force = found[0], found[3]
    np.testing.assert_allclose(x.time, [5.1, 5.35])
    np.testing.assert_allclose(x.measured, [0.0, 0.4])
    np.testing.assert_allclose((x.before, x.after), [[0.0, 0.1], [0.0, 0.3]])
    np.testing.assert_allclose(x.speed, [1.6, 1.6])  # 0.4 m in a quarter of a second
    np.testing.assert_allclose(force.measured, [2.0, 1.0])
    np.testing.assert_allclose(force.position, [0.0, 0.4])


def gap(placed, x, moved, residuals=True):
    """A trial whose simulation differs from what was there in one number."""
    changed = {"position": LEFT["position"] + np.array([[0.0, 0.0, 0.0], [moved, 0.0, 0.0]])}
    return CaptureTrial(placed, fit_of([placed], [x], 0.0, [changed] if residuals else []), 1.0, 0.1)


V = 4 * (0.01 / 6 + 1.5e-4**2)
"""[m²] What squares of `LEFT` are divided by."""


def test_a_limit_is_where_the_change_reaches_the_bar_as_it_grows_with_the_handle():
    """Half of 0.05² over v at a friction of 0.1, by its root to the bar; an umbilical's is its handle squared."""
    trials = [gap(FRICTION, 0.1, 0.05), gap(UMBILICAL, 10.0, 0.05)]
    found = _limits(MODEL, searched(simulated(0.3), simulated(0.3), opening=tuple(trials)), [OWN])
    grown = np.sqrt(5.0 / (0.5 * 0.05**2 / V))
    friction, umbilical = found
    assert (friction.name, friction.at, friction.parameter, friction.unit) == (
        "contact_friction",
        "pin",
        "coefficient",
        "1",
    )
    assert friction.value == pytest.approx(0.1 * grown, rel=1e-9)
    assert umbilical.value == pytest.approx((10.0 * grown) ** 2, rel=1e-9)


@pytest.mark.parametrize(
    "trial",
    [
        gap(FRICTION, 0.1, 0.05, residuals=False),
        gap(FRICTION, 0.1, 0.0),  # nothing changes
        gap(FRICTION, 0.0, 0.05),  # its handle did not move
        gap(FRICTION, 0.1, 0.005),  # the bar is reached beyond the handle's bound of 1.5
    ],
)
def test_there_is_no_limit_where_the_recordings_say_nothing_or_beyond_the_bounds(trial):
    assert _limits(MODEL, searched(simulated(0.3), simulated(0.3), opening=(trial,)), [OWN]) == ()


def test_what_was_named_or_is_a_number_of_the_set_up_has_no_limit():
    mass: Any = SimpleNamespace(key="mass.capture", effect=SimpleNamespace(name="mass"))
    last = simulated(0.3, [FRICTION], [0.1], [1.0])
    found = searched(
        simulated(0.3),
        last,
        [named(FRICTION, last, last, last)],
        opening=(gap(FRICTION, 0.1, 0.05), gap(mass, 1.0, 0.05)),
    )
    assert _limits(MODEL, found, [OWN]) == ()


def test_parameters_that_the_model_had_are_told_before_and_after():
    """An umbilical's handle from 10 to 11: its value from 100 to 121 N/m."""
    first = simulated(0.2, [UMBILICAL], [10.0], [1.0])
    last = simulated(0.3, [UMBILICAL, FRICTION], [11.0, 0.2], [1.0, 0.0])
    (moved,) = _moved(MODEL, searched(first, last, [named(FRICTION, last, first, last)]), [OWN])
    assert (moved.name, moved.unit) == ("umbilical_stiffness.target.stiffness", "N/m")
    assert (moved.before, moved.after) == pytest.approx((100.0, 121.0))
    assert moved.std == pytest.approx(np.sqrt(V) * (12.0**2 - 11.0**2), rel=1e-9)


def test_a_finding_tells_the_channel_that_it_made_best_and_rivals_that_count(monkeypatch):
    """Held out, x is off by 0.2 m and then 0.1 m. A name right nine times in ten shares that with rivals."""
    monkeypatch.setattr(module, "reliability", lambda margin: 0.9 if margin == 0.8 else 0.0)
    last = simulated(0.3, [FRICTION], [0.2], [2.0])
    rivals = [
        RivalOdds(PRETENSION, 0.1, True),
        RivalOdds(CLEARANCE, 0.005, True),
        RivalOdds(UMBILICAL, 0.0049, True),
        RivalOdds(PlacedEffect(UMBILICAL.effect, "other"), 0.001, False),
    ]
    one = named(FRICTION, last, simulated(0.2), simulated(0.3), explained=0.6, margin=0.8, rivals=rivals)
    found = _finding(one, searched(simulated(0.2), last, [one]), [OWN], [OWN])
    assert (found.name, found.at, found.margin) == ("contact_friction", "pin", 0.8)
    assert found.probability == pytest.approx(0.72)
    assert [(r.name, r.at, r.separable) for r in found.rivals] == [
        ("cable_pretension", "cables", True),
        ("hang_point_clearance", "target", True),
        ("umbilical_stiffness", "other", False),
    ]
    assert [r.probability for r in found.rivals] == pytest.approx([0.09, 0.0045, 0.0009])
    assert found.evidence == (
        "The cables rub on the pin and drag it along where they slide: it explains 60 % of the remaining "
        "residual. Without it, the error of pos.target.x on the held-out capture rises from 70.7 mm to 141 mm."
    )
    assert found.parameters["coefficient"].value == pytest.approx(0.2)
    assert found.parameters["coefficient"].std == pytest.approx(np.sqrt(V) / 2)


def test_one_name_and_several_are_listed_with_what_the_worst_channel_gains():
    fits = _fits(searched(simulated(0.2), simulated(0.36)), [OWN], [OWN])
    some: Any = [
        SimpleNamespace(name=n, at=a, probability=0.99)
        for n, a in (("contact_friction", "pin"), ("mass", "capture"), ("x", "y"))
    ]
    said = [_sentence(some[:k], fits, "") for k in (1, 2, 3)]
    assert said[0].startswith("The model leaves out contact friction at pin. With that added")
    assert "contact friction at pin and mass at capture." in said[1]
    assert "contact friction at pin, mass at capture and x at y." in said[2]
    # 0.2 m and 0.04 m in one of two numbers.
    assert said[0].endswith("the error of pos.target.x on the held-out capture falls from 141 mm to 28.3 mm.")


@pytest.mark.parametrize(
    ("left", "motion_of", "told"),
    [(0.176, 1.0, False), (0.178, 1.0, True), (0.00099, 0.001, False), (0.00101, 0.001, True)],
)
def test_motion_without_a_name_is_a_quarter_of_the_largest_and_a_millimetre(left, motion_of, told):
    """A metre that half of the numbers show is an RMS of 0.707 m, of which a quarter is 0.177 m."""
    own = capture(track(along(0.0, motion_of)))
    after = fit_of([], [], 0.0, [LEFT], [track(along(left * 2**0.5, motion_of))])
    fits = _fits(searched(after, after), [own], [own])
    assert fits[0].train.rms_after == pytest.approx(left)
    assert bool(_unexplained(fits)) is told


@pytest.mark.parametrize(("moved", "verdict"), [(0.4, "adequate"), (0.1, "unknown_effect")])
def test_a_whole_answer_without_a_name(moved, verdict):
    """What is met is adequate; of 0.4 m of motion 0.3 m missed is something without a name."""
    there = simulated(moved)
    trials = tuple(
        CaptureTrial(p, fit_of([p], [0.1], 0.0), score, explained)
        for p, score, explained in ((FRICTION, 1.0, 0.1), (PRETENSION, 2.0, 0.3), (CLEARANCE, -np.inf, 0.0))
    )
    found = searched(there, there, opening=trials, rejected=(UMBILICAL,))
    said = report_on(MODEL, found, [OWN], [capture(motion(0.4), path="data/b.csv")], 12.4, 37)
    assert said.verdict == verdict
    assert [(c.name, c.explained, c.score, c.named) for c in said.candidates] == [
        ("cable_pretension", 0.3, 2.0, False),
        ("contact_friction", 0.1, 1.0, False),
    ]
    assert said.notes[0].startswith("umbilical_stiffness at target passed on the training recordings")
    assert said.notes[-1] == "37 captures were simulated in 12 s"
    assert said.effects == ()


def test_a_whole_answer_with_a_name_and_a_number_that_was_corrected(monkeypatch):
    """The mass is a number of the set-up: it is told at the end of the sentence, and is no finding."""
    mass: Any = SimpleNamespace(
        key="mass.capture",
        at="capture",
        hold=(),
        effect=SimpleNamespace(name="mass", parameters=[SimpleNamespace(name="value", unit="kg")]),
    )
    monkeypatch.setattr(module, "absent", lambda _model, _placed: 1.0)  # ten kilograms
    last = simulated(0.36, [FRICTION, mass], [0.2, 2.0], [1.0, 0.0])
    names = [named(p, last, simulated(0.2), simulated(0.36)) for p in (FRICTION, mass)]
    said = report_on(MODEL, searched(simulated(0.2), last, names), [OWN], [OWN], 1.0, 1)
    assert said.verdict == "missing_physics"
    assert [f.name for f in said.effects] == ["contact_friction"]
    assert said.sentence.endswith("fit better as mass = 100 kg.")
    assert f"the error of {said.foremost} on" in said.sentence
    (moved,) = said.moved
    assert (moved.name, moved.unit) == ("capture.mass", "kg")
    assert (moved.before, moved.after) == pytest.approx((10.0, 100.0))
