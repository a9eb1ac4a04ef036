"""The torques' answer: verdict and words by what was decided, probabilities, misfits, noise and excitation by hand."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from encoder_pairs import RATE, placed
from small_answers import MODEL, NAMES, experiment, fit

from snarelab.identification import answer
from snarelab.identification.decision.confirm import Loss
from snarelab.identification.decision.decide import Decision
from snarelab.identification.decision.nameless import NamelessParts
from snarelab.identification.decision.selection import Naming, Remainder, RivalOdds, Trial
from snarelab.identification.diagnosis import ChannelFit, Finding, Misfit, Step
from snarelab.identification.nuisance.bursts import Bursts
from snarelab.identification.nuisance.noise import Noise

COULOMB, BACKLASH, BIAS = (placed(n, "joint1") for n in ("coulomb_friction", "backlash", "sensor_bias"))
QUIET = Noise(0.1, 0.2, 0.3, 0.4, 8.0, 0.5)
HEARD = "0.1 N·m from sample to sample, 0.2 N·m over 0.3 s, a wander of 0.4 N·m over 8 s and 5 N·m of the encoders"


def name(effect, share=0.5, gain=30.0, rivals=(), channels=(0,)) -> Naming:
    return Naming(effect, channels, gain, share, tuple(RivalOdds(*r) for r in rivals))


def trial(effect, explained=0.5, odds=3.0, smallest=()) -> Trial:
    return Trial(effect, explained, odds, dict(smallest))


def curve(channel, over, explained) -> Remainder:
    return Remainder(channel, over, 20.0, explained, 3.0)


def decided(*, names=(), rest=(), bursting=(), rejected=(), missed=None, **found) -> Decision[Any]:
    best: Any = SimpleNamespace(names=tuple(names), missed=missed or {}, found=SimpleNamespace(**found))
    return Decision(best, NamelessParts(tuple(rest), dict(bursting)), tuple(rejected))


@pytest.fixture
def reported(monkeypatch):
    """The report on what was decided; ``relative`` is what is left of each channel's torque."""

    def report(*, names=(), rest=(), bursting=(), rejected=(), trials=(), relative: Any = 0.1, train=None, held=()):
        left = np.broadcast_to(relative, 3)
        both = [(Misfit(9, 9, 9, x), Misfit(9, 9, x, x / 2)) for x in left]
        fits = [ChannelFit(f"tau.{n}", u, *own, 0) for n, u, own in zip(NAMES, ("N*m", "N", "N*m"), both, strict=True)]
        monkeypatch.setattr(answer, "channel_fits", lambda *_: tuple(fits))
        monkeypatch.setattr(
            answer, "_finding", lambda n, *_: Finding(n.placed.effect.name, n.placed.at, 1, 1, {}, "", ())
        )
        monkeypatch.setattr(answer, "locate", lambda _, explained: tuple(explained))
        for part in ("moved", "traces", "_limits"):
            monkeypatch.setattr(answer, part, lambda *_, part=part: part)
        monkeypatch.setattr(answer, "_excitation", lambda _: ["excited"])
        encoders = ([3.0, 1.0, 0.0], [np.sqrt(41), 1.0, 0.0])  # of two recordings: their RMS is 5, 1 and nothing
        weighed = SimpleNamespace(
            noises=[replace(QUIET, white=w) for w in (0.1, 0.0123, 4.0)],
            runs=[[SimpleNamespace(encoder=np.full(4, x)) for x in row] for row in encoders],
        )
        told = decided(
            names=names,
            rest=rest,
            bursting=bursting,
            rejected=rejected,
            trials=trials,
            weighed=weighed,
            first=SimpleNamespace(fit=fit([1, 1, 1])),
        )
        train = train or [experiment(np.ones((4, 3)))]
        return answer.report_on(MODEL, told, fit([3, 5, 7]), (Step("s", 1, 1),), train, held)

    return report


def words(channel, over, share, size):
    return (
        f"on tau.{channel}, a smooth curve over {over} still explains {share} of the residual "
        f"({size} of the channel's torque)"
    )


@pytest.mark.parametrize(
    ("names", "rest", "verdict"),
    [
        ((), (), "adequate"),
        ((), (curve(1, "load", 0.01),), "unknown_effect"),
        ((name(COULOMB),), (), "missing_physics"),
        ((name(COULOMB),), (curve(1, "load", 0.9),), "missing_physics"),
    ],
)
def test_the_verdict_depends_on_names_first_and_on_nameless_curves_then(reported, names, rest, verdict):
    made = reported(names=names, rest=rest)
    assert made.verdict == verdict
    assert bool(made.description) is bool(rest)
    assert [(e.name, e.at) for e in made.effects] == [("coulomb_friction", "joint1")] * len(names)


def test_without_a_finding_the_sentence_tells_what_has_no_name_and_where(reported):
    """Of the two channels with a curve the worse; joint1 misses more, but has nothing to say."""
    made = reported(rest=[curve(2, "time", 0.64), curve(1, "load", 0.25)], relative=(0.9, 0.2, 0.4))
    one, two = words("joint3", "time", "64 %", "32 %"), words("joint2", "load", "25 %", "10 %")
    assert made.description == f"{one}; {two}"
    assert made.sentence == (
        f"Something is missing on tau.joint3 that no effect of the vocabulary explains. O{one[1:]}; {two}."
    )
    assert made.foremost == "tau.joint3"
    # What is located is the residual itself there, measured 1 less modelled 3, 5 and 7, and nothing elsewhere.
    (residual,) = cast(Any, made.location)
    assert residual.tolist() == [[0.0, -4.0, -6.0]] * 4


def test_with_a_finding_the_rest_is_told_by_its_channels(reported):
    """What is located is the change of the model's torque: from 1 to 3, 5 and 7."""
    rest = [curve(2, "time", 0.64), curve(0, "load", 0.25), curve(2, "speed", 0.1)]
    made = reported(names=[name(COULOMB)], rest=rest, relative=(0.9, 0.001, 0.4))
    assert made.sentence == (
        "The model leaves out Coulomb friction at joint1. With that added, the error of tau.joint1 on the held-out "
        "recording falls from 90 % to 45 %. Part of the remaining residual of tau.joint1 and tau.joint3 has no name."
    )
    assert made.foremost == "tau.joint1"
    assert made.description == "; ".join(
        (
            words("joint3", "time", "64 %", "32 %"),
            words("joint1", "load", "25 %", "45 %"),
            words("joint3", "speed", "10 %", "13 %"),
        )
    )
    (change,) = cast(Any, made.location)
    assert change.tolist() == [[2.0, 4.0, 6.0]] * 4
    assert reported(names=[name(COULOMB)]).sentence.endswith("from 10 % to 5.0 %.")


def test_an_adequate_model_is_told_by_the_worst_channel(reported):
    made = reported(relative=(0.02, 0.03, 0.01))
    assert (made.verdict, made.description) == ("adequate", "")
    assert made.sentence.endswith(f" is 2.0 % of tau.joint1. It is noise: {HEARD}.")
    assert (made.model, made.steps, made.moved, made.traces, made.limits) == (
        "arm", (Step("s", 1, 1),), "moved", "traces", "_limits",
    )  # fmt: skip
    assert made.band == RATE / 2
    (nothing,) = cast(Any, made.location)
    assert not nothing.any()


def test_notes_tell_the_recordings_first_then_what_was_not_named_then_the_noise(reported):
    """A name that another attempt had rejected, and the best one kept, is not said to be unnamed."""
    train = [experiment(np.ones((4, 3)), "/d/a.csv", ["n1", "n2"]), experiment(np.ones((4, 3)), "/d/b.csv", ["n3"])]
    held = [experiment(np.ones((4, 3)), "/d/h.csv", ["n4"])]
    made = reported(names=[name(COULOMB)], rejected=[name(BACKLASH), name(COULOMB)], train=train, held=held)
    assert made.notes[:5] == (
        "a.csv: n1",
        "a.csv: n2",
        "b.csv: n3",
        "h.csv: n4",
        "backlash at joint1 passed on the training recordings, but the held-out ones are predicted no better with it: "
        "not named",
    )
    assert made.notes[5] == f"noise of tau.joint1: {HEARD}"
    assert made.notes[6].startswith("noise of tau.joint2: 0.012 N from sample to sample, 0.2 N over 0.3 s,")
    assert made.notes[6].endswith("and 1 N of the encoders")
    assert made.notes[7].startswith("noise of tau.joint3: 4 N·m from sample to sample,")
    assert made.notes[8:] == ("excited",)


@pytest.mark.parametrize("again", [True, False])
@pytest.mark.parametrize("curves", [(), (curve(1, "speed", 0.49),)])
def test_bursts_have_no_name_unless_they_came_once(reported, again, curves):
    made = reported(rest=curves, bursting=[(2, Bursts(0.36, 12.345, again))], relative=0.1)
    text = (
        "on tau.joint3, 36 % of the residual comes in bursts, at 12 Hz where it is strongest "
        "(6.0 % of the channel's torque)"
    )
    smooth = [words("joint2", "speed", "49 %", "7.0 %")] * len(curves)
    assert made.description == "; ".join([*smooth, *[text] * again])
    assert made.verdict == ("unknown_effect" if again or curves else "adequate")
    knock = "on tau.joint3, 36 % of the residual comes in bursts that do not recur: a knock, or outliers"
    assert (knock in made.notes) is not again
    (residual,) = cast(Any, made.location)
    assert np.flatnonzero(residual[0]).tolist() == [1] * len(curves) + [2] * again


def test_candidates_are_what_explains_anything_by_itself(reported):
    trials = [trial(COULOMB, 0.4, 9.5), trial(BIAS, 0.1, -2.0), trial(BACKLASH, 0.0, -3.0)]
    made = reported(names=[name(COULOMB)], trials=trials)
    assert [tuple(vars(c).values()) for c in made.candidates] == [
        ("coulomb_friction", "joint1", 0.4, 9.5, True),
        ("sensor_bias", "joint1", 0.1, -2.0, False),
    ]


def found(monkeypatch, right, share, rivals) -> Finding:
    """The finding of a name that is right in so many of all cases with its evidence: 30, 2.5 errors, and 15/16."""
    monkeypatch.setattr(answer, "of_name", lambda *own: right if own == (30.0, 2.5, 0.9375) else np.nan)
    slots = [SimpleNamespace(name=n, unit=u) for n, u in (("other", "m"), ("level", "N*m"), ("more", "s"))]
    final = fit([1, 2, 3], std=[0.1, 0.2, 0.3], at_bound=np.array([True, False, True]),
                assembly={"slots": slots, "index_of": lambda p: [1, 2]})  # fmt: skip
    own = name(COULOMB, share, rivals=rivals, channels=(2, 0))
    told = decided(names=[own], missed={COULOMB.key: Loss(5.0, 2.0, 0.08, 0, None)})
    monkeypatch.setattr(answer, "_trial", lambda *_: (0.02, 0.08))
    monkeypatch.setattr(answer, "_share_of_energy", lambda *_: 0.9375)
    cast(Any, told.best).last = SimpleNamespace(fit=final)
    return answer._finding(own, told, final, [], ["tau.a", "tau.b", "tau.c"])


def test_an_effect_and_what_cannot_be_told_from_it_share_how_often_such_a_name_was_right(monkeypatch):
    """It has half of the posterior, with its twins 0.75: right in 0.6 of all cases, of which it has two thirds."""
    rivals = ((BACKLASH, 0.246, False), (COULOMB, 0.004, False), (BIAS, 0.2, True), (BACKLASH, 0.005, True))
    made = found(monkeypatch, 0.6, 0.5, rivals)
    assert (made.name, made.at, made.margin, made.gain) == ("coulomb_friction", "joint1", 2.5, 30.0)
    assert made.probability == pytest.approx(0.4)
    assert [(r.name, r.separable) for r in made.rivals] == [
        ("backlash", False),
        ("coulomb_friction", False),
        ("sensor_bias", True),
        ("backlash", True),
    ]
    assert [r.probability for r in made.rivals] == pytest.approx([0.246 * 0.8, 0.0032, 0.12, 0.003])
    assert {n: tuple(vars(e).values()) for n, e in made.parameters.items()} == {
        "level": (2.0, 0.2, "N*m", False),
        "more": (3.0, 0.3, "s", True),
    }
    assert made.evidence.endswith(
        "it explains 94 % of the remaining residual of tau.c and tau.a. Without it, the "
        "error on the held-out recording rises from 2.0 % to 8.0 %."
    )


def test_a_name_alone_in_its_place_is_as_likely_as_such_a_name_was_right(monkeypatch):
    """However little of the posterior it has: what is shared is shared among those that cannot be told apart."""
    assert found(monkeypatch, 0.6, 0.3, ((BIAS, 0.2, True),)).probability == pytest.approx(0.6)


def test_limits_are_told_by_parameter_with_its_unit():
    sling = trial(placed("sling_tension_error", "joint1"), smallest={"lag_loss": 0.3, "share": 0.2})
    trials = [sling, trial(BACKLASH), trial(BIAS, smallest={"offset": 4})]
    final = fit([1, 2, 3], assembly={"unit": lambda placed, p: f"{p.unit} of {placed.effect.name}"})
    assert [tuple(vars(x).values()) for x in answer._limits(decided(closing=trials), final)] == [
        ("sling_tension_error", "joint1", "share", 0.2, "1 of sling_tension_error"),
        ("sling_tension_error", "joint1", "lag_loss", 0.3, "N*s/m of sling_tension_error"),
        ("sensor_bias", "joint1", "offset", 4, "U of sensor_bias"),
    ]
