"""One answer out of what the torques say and what the encoders say: verdict, order, places, steps and the model."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from diagnoses import spelt
from encoder_pairs import SCALES, links, motion, placed, run

from snarelab.identification.decision.nameless import NamelessParts
from snarelab.identification.diagnosis import ChannelFit, Estimate, Finding, Location, Misfit, Step
from snarelab.identification.fitting.experiment import Experiment
from snarelab.identification.links import answer
from snarelab.identification.links.diagnose import EncoderComparison
from snarelab.identification.links.source import Links
from snarelab.identification.sources.decide import SourceDecision
from snarelab.identification.sources.source import Linearisation, ModelPoint

NONE = cast(Any, None)


def channel(name, before, after, unit="N*m"):
    """A channel whose held-out residual falls so; what was fitted is another matter."""
    return ChannelFit(name, unit, Misfit(9, 9, 9, 9), Misfit(before, after, before / 10, after / 10), 0.1)


def finding(name, at="q_link.joint1", value=0.5):
    first = Estimate(value, 0.1, "s" if name == "sensor_delay" else "")
    return Finding(name, at, 0.9, 0.8, {"first": first, "second": Estimate(99, 0.1, "")}, "", ())


@pytest.mark.parametrize(("before", "after", "told"), [(2, 1, 0.75), (10, 1, 0.99), (1, 2, 0.0), (3, 3, 0.0)])
def test_of_a_channel_is_told_the_share_of_its_held_out_energy(before, after, told):
    assert answer._told([channel("a", before, after)]) == pytest.approx([told])


def left(*sizes, channels=1):
    at = ModelPoint.of((), {}, 0)
    return Linearisation(at, tuple(np.full((len(x), channels), np.array(x, float)[:, None]) for x in sizes), ())


def test_a_misfit_is_relative_to_the_link_encoders_own_reading():
    """Fitted: motor 3 and -3, link 1 further out: the link reads 4 and -4. Held out: it reads 2."""
    runs = [run(np.full(64, 3.0), np.ones(64)), run(np.full(64, -3.0), -np.ones(64)), run(np.zeros(64), np.full(64, 2))]
    one = links(*runs, kind="prismatic", n_train=2)
    decided: Any = SimpleNamespace(
        found=SimpleNamespace(first=SimpleNamespace(train=left([2, -2], [2]))),
        train=left([1, 1], [1]),
        held=left([0.5]),
        before=left([1, -1]),
    )
    (made,) = answer._fits(EncoderComparison(one, decided, (), ()))
    assert (made.channel, made.unit) == ("q_link.joint1", "m")
    assert made.train == Misfit(2.0, 1.0, 0.5, 0.25)
    assert made.holdout == Misfit(1.0, 0.5, 0.5, 0.25)


@pytest.mark.parametrize(
    ("findings", "fits", "sentence"),
    [
        (
            [finding("sensor_delay", value=0.0123), finding("joint_elasticity", "joint2"),
             finding("sensor_delay", "q.joint3", 0.002)],
            [channel("x", 2e-3, 1e-3, "rad"), channel("y", 5e-3, 4e-3, "m"), channel("z", 9e-3, 9e-3, "m")],
            "Link and motor encoders differ by sensor delay of 12.3, 2 ms at q_link.joint1, q.joint3; joint elasticity "
            "at joint2. With that added, the remaining difference of y on the held-out recording falls from "
            "5 mm to 4 mm.",
        ),
        (
            [finding("joint_elasticity", "joint1"), finding("sensor_gain")],
            [channel("x", 2e-3, 3e-3, "rad"), channel("y", 1e-3, 1e-3, "rad")],  # none became better: the worst
            "Link and motor encoders differ by joint elasticity at joint1; sensor gain at q_link.joint1. With that "
            "added, the remaining difference of x on the held-out recording falls from 2 mrad to 3 mrad.",
        ),
        ([finding("sensor_bias")], [], "Link and motor encoders differ by sensor bias at q_link.joint1."),
    ],
)  # fmt: skip
def test_the_encoders_sentence_names_effects_with_their_places(findings, fits, sentence):
    moving = [f for f in findings if f.name != "sensor_bias"]
    assert answer._sentence(moving, [f for f in findings if f not in moving], fits) == sentence


TORQUES = replace(
    spelt("x"),
    sentence="Torques say.",
    description="",
    foremost="tau.joint1",
    effects=(finding("coulomb_friction", "joint1"),),
    fit=(channel("tau.joint1", 2, 1), channel("tau.joint2", 1, 1)),
)
"""Three quarters of what joint1 left are told."""


def answered(monkeypatch, torques, found=(), told=(1, 1), nameless=""):
    """The answer where the encoders gave these findings, and their one channel's residual fell so."""
    monkeypatch.setattr(answer, "candidates", lambda _: ["c"])
    monkeypatch.setattr(answer, "limits", lambda *_: ["l"])
    for name, mark in (("traces_of", "t"), ("notes_of", "n")):
        monkeypatch.setattr(answer, name, lambda _, mark=mark: [mark])
    monkeypatch.setattr(answer, "findings_of", lambda _: tuple(found))
    monkeypatch.setattr(answer, "nameless", lambda _: nameless)
    monkeypatch.setattr(answer, "_fits", lambda _: (channel("A", *told),))
    monkeypatch.setattr(answer, "_steps", lambda _: [Step("encoders", 0.5, 0.5)])
    monkeypatch.setattr(answer, "_location", lambda *_: ("places",))
    monkeypatch.setattr(answer, "with_found", lambda model, at: (model, at))
    names = [SimpleNamespace(placed=placed(f.name, f.at)) for f in found]
    best = SimpleNamespace(names=names, last=SimpleNamespace(train=SimpleNamespace(at="values")))
    none: Any = None
    decided = SourceDecision(
        cast(Any, best), NamelessParts(cast(Any, tuple(filter(None, [nameless]))), {}), (), none, none
    )
    source: Any = SimpleNamespace(still=lambda p: p.effect.name == "sensor_bias")
    return answer.with_links(torques, cast(Any, "model"), EncoderComparison(source, decided, (), ()))


def test_where_the_encoders_find_nothing_the_torques_answer_stands(monkeypatch):
    made, model = answered(monkeypatch, TORQUES)
    assert (made.verdict, made.sentence, made.description) == ("missing_physics", "Torques say.", "")
    assert made.effects == TORQUES.effects
    assert made.location == TORQUES.location
    assert [f.channel for f in made.fit] == ["tau.joint1", "tau.joint2", "A"]
    assert [s.label for s in made.steps] == ["x", "x", "encoders"]
    assert made.candidates[-1:] == ("c",)
    assert made.traces[-1:] == ("t",)
    assert made.limits[-1:] == ("l",)
    assert made.notes == ("x", "n")
    assert model == ("model", "values")


@pytest.mark.parametrize(("told", "first"), [((2, 1), True), ((2, 1.01), False), ((4, 1), True)])
def test_the_kind_of_channel_that_is_told_more_of_goes_first(monkeypatch, told, first):
    """The torques' best channel is told three quarters; a zero that differs comes last of all."""
    found = [finding("sensor_gain"), finding("sensor_bias")]
    made, _ = answered(monkeypatch, TORQUES, found, told)
    own = ["sensor_gain", "coulomb_friction"] if first else ["coulomb_friction", "sensor_gain"]
    assert [f.name for f in made.effects] == [*own, "sensor_bias"]
    assert made.sentence.startswith("Link and motor" if first else "Torques say. Link and motor")
    assert made.sentence.endswith("Torques say.") is first
    assert [f.channel for f in made.fit] == (
        ["A", "tau.joint1", "tau.joint2"] if first else ["tau.joint1", "tau.joint2", "A"]
    )
    assert (made.steps[0].label == "encoders") is first
    assert made.foremost == ("A" if first else TORQUES.foremost)
    assert made.location == ("places",)
    assert "sensor bias" not in made.sentence


def test_where_the_torques_name_nothing_the_encoders_go_first_however_little_they_tell(monkeypatch):
    quiet = replace(TORQUES, verdict="adequate", effects=())
    made, _ = answered(monkeypatch, quiet, [finding("sensor_bias")])
    assert made.verdict == "missing_physics"
    assert made.sentence == (
        "Link and motor encoders differ by sensor bias at q_link.joint1. "
        "The torques show nothing that the model leaves out."
    )
    assert [f.name for f in made.effects] == ["sensor_bias"]
    assert made.fit[0].channel == "A"


def test_what_both_kinds_of_channels_name_at_one_place_is_told_by_the_encoders(monkeypatch):
    both = replace(TORQUES, effects=(finding("backlash", "joint1"), finding("backlash", "joint2")))
    made, _ = answered(monkeypatch, both, [finding("backlash", "joint1", 7.0)], (1, 1))
    assert [(f.at, f.parameters["first"].value) for f in made.effects] == [("joint2", 0.5), ("joint1", 7.0)]


@pytest.mark.parametrize(
    ("verdict", "description", "found", "wanted"),
    [
        ("adequate", "", "b", ("unknown_effect", "b")),
        ("unknown_effect", "a", "b", ("unknown_effect", "a; b")),
        ("missing_physics", "a", "b", ("missing_physics", "a")),
        ("adequate", "", "", ("adequate", "")),
    ],
)
def test_what_has_no_name_on_the_encoders_makes_an_unknown_effect(monkeypatch, verdict, description, found, wanted):
    said = replace(TORQUES, verdict=verdict, description=description)
    made, _ = answered(monkeypatch, said, nameless=found)
    assert (made.verdict, made.description) == wanted
    told = f"Something is missing that no effect of the vocabulary explains: {wanted[1]}."
    assert made.sentence == (told if wanted[0] == "unknown_effect" else "Torques say.")


def test_places_stand_by_the_share_that_is_told_of_each_channel(monkeypatch):
    """Of tau.joint1 three quarters, of tau.joint2 nothing, of joint2's encoders 0.96, of joint1's nothing named."""
    seen = {}

    def locate(loaded, changes):
        seen.update(tau=[e.motion.tau for e in loaded], changes=changes)
        return (Location("tau.joint2", 1.0, ((0.0, 1.0),), "fast"),)

    monkeypatch.setattr(answer, "locate", locate)
    names = ("joint1", "joint2")
    motions = [motion(np.zeros((n, 2)), np.ones((n, 2)), joints=names) for n in (3, 2)]
    runs = [replace(run(m.q, m.tau, joint=1, joints=names), load=np.arange(len(m.time)) + 5.0) for m in motions]
    rows: Any = [[None, r] for r in runs]
    source: Any = SimpleNamespace(rows=rows, channels=("q_link.joint1", "q_link.joint2"))
    best = SimpleNamespace(names=[SimpleNamespace(channels=(1,))])
    first = SimpleNamespace(train=left([1, 2, 3], [4, 5], channels=2))
    after = left([1, 1, 1], [1, 1], channels=2)
    decided: Any = SimpleNamespace(found=SimpleNamespace(first=first), best=best, train=after)
    train = tuple(Experiment(m, NONE) for m in motions)
    places = tuple(Location(f"tau.joint{k}", 0.5, (), "") for k in (2, 1, 3))
    said = replace(TORQUES, location=places)
    fits = [channel("q_link.joint1", 4, 1), channel("q_link.joint2", 5, 1)]
    one, two = answer._location(said, EncoderComparison(source, decided, (), train), fits)
    assert [t.tolist() for t in seen["tau"]] == [[[0, 5], [0, 6], [0, 7]], [[0, 5], [0, 6]]]
    assert [c.tolist() for c in seen["changes"]] == [[[0, 0], [0, 1], [0, 2]], [[0, 3], [0, 4]]]
    assert (one.channel, one.where, two.channel) == ("q_link.joint2", "fast", "tau.joint1")
    assert (one.share, two.share) == pytest.approx((0.96 / 1.71, 0.75 / 1.71))
    assert one.share + two.share < 1


def test_a_steps_error_is_the_root_of_the_mean_share_of_every_joints_reading():
    """Two joints that read 4 and 8; left over of the first 2, of the second 4, then 1 and 4."""
    rows = [[run(np.zeros(4), np.full(4, x)) for x in (4.0, 8.0)] for _ in range(2)]
    source = Links(["joint1", "joint2"], ("revolute", "revolute"), [SCALES] * 2, rows, 1)

    def both(a, b):
        return Linearisation(ModelPoint.of((), {}, 0), (np.tile([a, b], (4, 1)),), ())

    stages = (("as given", both(2.0, 4.0), both(4.0, 8.0)), ("+ more", both(1.0, 4.0), both(0.0, 4.0)))
    lines = answer._steps(EncoderComparison(source, NONE, stages, ()))
    assert [x.label for x in lines] == ["as given", "+ more"]
    assert [x.train for x in lines] == pytest.approx([0.5, np.sqrt((1 / 16 + 1 / 4) / 2)])
    assert [x.holdout for x in lines] == pytest.approx([1.0, np.sqrt(1 / 8)])
