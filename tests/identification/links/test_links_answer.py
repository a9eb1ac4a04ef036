"""One answer out of what the torques say and what the encoders say: verdict, order, places, steps and the model."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from diagnoses import spelt
from encoder_pairs import link, motion, named, placed, run

from snarelab.identification.diagnosis import ChannelFit, Estimate, Finding, Location, Misfit, Step
from snarelab.identification.fitting.experiment import Experiment
from snarelab.identification.links import answer
from snarelab.identification.links.diagnose import Offset, Proof
from snarelab.identification.links.pair import PairFit

GAIN, DRIFT = placed("sensor_gain", "q_link.joint1"), placed("sensor_drift", "q_link.joint1")
NONE = cast(Any, None)


def channel(name, before, after, unit="N*m"):
    """A channel whose held-out residual falls so; what was fitted is another matter."""
    return ChannelFit(name, unit, Misfit(9, 9, 9, 9), Misfit(before, after, before / 10, after / 10), 0.1)


def finding(name, at="q_link.joint1", value=0.5):
    return Finding(name, at, 0.9, 0.8, {"first": Estimate(value, 0.1, ""), "second": Estimate(99, 0.1, "")}, "", ())


def fit(*effects, theta=(), residual=(1.0,)):
    return PairFit(effects, np.array(theta, float), np.array(residual, float), np.zeros((len(residual), len(theta))))


def proof(effect):
    return Proof(named(effect), 2.0, 1.0)


@pytest.mark.parametrize(("before", "after", "told"), [(2, 1, 0.75), (10, 1, 0.99), (1, 2, 0.0), (3, 3, 0.0)])
def test_of_a_channel_is_told_the_share_of_its_held_out_energy(before, after, told):
    assert answer._told([channel("a", before, after)]) == pytest.approx([told])


def test_a_misfit_is_relative_to_the_link_encoders_own_reading():
    """Fitted: motor 3 and -3, link 1 further out: the link reads 4 and -4. Held out: it reads 2."""
    one = link(
        joint="joint2",
        kind="prismatic",
        runs=[run(np.full(64, 3.0), np.ones(64)), run(np.full(32, -3.0), -np.ones(32))],
        locked=[run(np.zeros(64), np.full(64, 2.0))],
        steps=(fit(residual=[2, -2]), fit(residual=[9]), fit(residual=[1, 1])),
        held=(fit(residual=[1, -1]), fit(residual=[9]), fit(residual=[0.5])),
    )
    made = answer._fit(one)
    assert (made.channel, made.unit) == ("q_link.joint2", "m")
    assert made.train == Misfit(2.0, 1.0, 0.5, 0.25)
    assert made.holdout == Misfit(1.0, 0.5, 0.5, 0.25)


@pytest.mark.parametrize(
    ("findings", "fits", "sentence"),
    [
        ([], [], ""),
        (
            [finding("sensor_delay", value=0.0123), finding("joint_elasticity", "joint2"),
             finding("sensor_delay", "q.joint3", 0.002)],
            [channel("x", 2e-3, 1e-3, "rad"), channel("y", 5e-3, 4e-3, "m"), channel("z", 9e-3, 9e-3, "m")],
            "Link and motor encoders differ by sensor delay of 12.3, 2 ms at q_link.joint1, q.joint3; joint elasticity "
            "at joint2. With that added, the difference left on y, on the held-out recording, falls from "
            "5 mm to 4 mm.",
        ),
        (
            [finding("sensor_bias"), finding("sensor_gain")],
            [channel("x", 2e-3, 3e-3, "rad"), channel("y", 1e-3, 1e-3, "rad")],  # none became better: the worst
            "Link and motor encoders differ by sensor bias at q_link.joint1; sensor gain at q_link.joint1. With that "
            "added, the difference left on x, on the held-out recording, falls from 2 mrad to 3 mrad.",
        ),
        ([finding("sensor_bias")], [], "Link and motor encoders differ by sensor bias at q_link.joint1."),
    ],
)  # fmt: skip
def test_the_encoders_sentence_names_effects_with_their_places(findings, fits, sentence):
    assert answer._sentence(findings, fits) == sentence


TORQUES = replace(
    spelt("x"),
    sentence="Torques say.",
    description="",
    foremost="tau.joint1",
    effects=(finding("coulomb_friction", "joint1"),),
    fit=(channel("tau.joint1", 2, 1), channel("tau.joint2", 1, 1)),
)
"""Three quarters of what joint1 left are told."""


def answered(monkeypatch, torques, found=(), told=(1, 1), nameless=()):
    """The answer where the encoders gave these findings, and their one channel's residual fell so."""
    for name, mark in (("candidates_of", "c"), ("traces_of", "t"), ("limits_of", "l"), ("notes_of", "n")):
        monkeypatch.setattr(answer, name, lambda one, mark=mark: [mark + one])
    monkeypatch.setattr(answer, "findings_of", lambda _: tuple(found))
    monkeypatch.setattr(answer, "nameless", lambda one: dict(nameless).get(one, ""))
    monkeypatch.setattr(answer, "_fit", lambda one: channel(one, *told))
    monkeypatch.setattr(answer, "_steps", lambda _: [Step("encoders", 0.5, 0.5)])
    monkeypatch.setattr(answer, "_location", lambda *_: ("places",))
    monkeypatch.setattr(answer, "_model", lambda model, links: (model, links))
    links: Any = ["A", "B"]
    return answer.with_links(torques, cast(Any, "model"), links, [])


def test_where_the_encoders_find_nothing_the_torques_answer_stands(monkeypatch):
    made, model = answered(monkeypatch, TORQUES)
    assert (made.verdict, made.sentence, made.description) == ("missing_physics", "Torques say.", "")
    assert made.effects == TORQUES.effects
    assert made.location == TORQUES.location
    assert [f.channel for f in made.fit] == ["tau.joint1", "tau.joint2", "A", "B"]
    assert [s.label for s in made.steps] == ["x", "x", "encoders"]
    assert made.candidates[-2:] == ("cA", "cB")
    assert made.traces[-2:] == ("tA", "tB")
    assert made.limits[-2:] == ("lA", "lB")
    assert made.notes == ("x", "nA", "nB")
    assert model == ("model", ["A", "B"])


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
        ["A", "B", "tau.joint1", "tau.joint2"] if first else ["tau.joint1", "tau.joint2", "A", "B"]
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
        "The torques ask for nothing that these recordings can show."
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
    made, _ = answered(monkeypatch, said, nameless=(("B", found),))
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
    steps = (fit(residual=[1, 2, 3, 4, 5]), fit(residual=[9] * 5), fit(residual=[1, 1, 1, 1, 1]))
    links = [link(), link(joint="joint2", runs=runs, steps=steps, proofs=(proof(GAIN),))]
    places = tuple(Location(f"tau.joint{k}", 0.5, (), "") for k in (2, 1, 3))
    said = replace(TORQUES, location=places)
    train = [Experiment(m, NONE) for m in motions]
    fits = [channel("q_link.joint1", 4, 1), channel("q_link.joint2", 5, 1)]
    one, two = answer._location(said, links, fits, train)
    assert [t.tolist() for t in seen["tau"]] == [[[0, 5], [0, 6], [0, 7]], [[0, 5], [0, 6]]]
    assert [c.tolist() for c in seen["changes"]] == [[[0, 0], [0, 1], [0, 2]], [[0, 3], [0, 4]]]
    assert (one.channel, one.where, two.channel) == ("q_link.joint2", "fast", "tau.joint1")
    assert (one.share, two.share) == pytest.approx((0.96 / 1.71, 0.75 / 1.71))
    assert one.share + two.share < 1


def test_steps_add_each_effect_at_all_its_joints_at_once():
    """Two joints that read 4 over 4 samples, 2 held out; each line's misfit is the root of their mean energies' share.

    Energies of joint1: 16, 4, 1; of joint2: 36, 9; over 64 each. Held out half as much RMS, over 16.
    """
    given: dict[str, Any] = {"runs": [run(np.zeros(4), np.full(4, 4.0))], "locked": [run(np.full(4, 1.0), np.ones(4))]}
    sizes = {"joint1": (2, 1, 0.5), "joint2": (3, 1.5)}
    delays = {j: placed("sensor_delay", f"q_link.{j}") for j in sizes}
    proofs = {"joint1": (proof(GAIN), proof(delays["joint1"])), "joint2": (proof(delays["joint2"]),)}
    links = [
        link(joint=j, proofs=proofs[j], **given, steps=[fit(residual=np.full(4, x)) for x in rms],
             held=[fit(residual=np.full(4, x / 2)) for x in rms])
        for j, rms in sizes.items()
    ]  # fmt: skip
    lines = answer._steps(links)
    assert [x.label for x in lines] == [
        "link encoders as given",
        "+ sensor_gain at q_link.joint1",
        "+ sensor_delay at q_link.joint2",
        "+ sensor_delay at q_link.joint1",
    ]
    energies = np.array([[16, 36], [4, 36], [4, 9], [1, 9]])
    np.testing.assert_allclose([x.train for x in lines], np.sqrt(np.mean(energies / 64, axis=1)))
    np.testing.assert_allclose([x.holdout for x in lines], np.sqrt(np.mean(energies / 4 / 16, axis=1)))


def test_an_effect_at_two_joints_in_one_depth_is_one_step():
    given: dict[str, Any] = {"runs": [run(np.zeros(4), np.full(4, 4.0))], "locked": [run(np.zeros(4), np.ones(4))]}
    both = [
        link(joint=j, proofs=(proof(placed("sensor_gain", f"q_link.{j}")),), **given,
             steps=(fit(), fit()), held=(fit(), fit()))
        for j in ("joint1", "joint2")
    ]  # fmt: skip
    assert [x.label for x in answer._steps(both)][1:] == ["+ sensor_gain at q_link.joint1, q_link.joint2"]


def test_the_model_gets_what_the_last_step_has_and_the_shared_zero():
    """What it had elsewhere stays; what it had of an effect named anew is replaced."""
    old = placed("coulomb_friction", "joint1")
    spring = placed("joint_elasticity", "joint2")
    model: Any = SimpleNamespace(effects=(old, DRIFT), values={"sensor_drift.q_link.joint1.rate": 9.0, "kept": 1.0})
    steps = (fit(GAIN, theta=(8.0, 0.0)), fit(DRIFT, GAIN, theta=(0.25, 0.5, 3.0)))
    links = [
        link(steps=steps, offset=Offset(0.125, 0.1, 1.0, 1.0)),
        link(joint="joint2", steps=(fit(spring, theta=(100.0, 7.0, 0.0)),)),
    ]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(answer, "replace", lambda _, **changes: changes)
        made = cast(Any, answer._model(model, links))
    assert [p.key for p in made["effects"]] == [
        old.key,
        DRIFT.key,
        GAIN.key,
        "sensor_bias.q_link.joint1",
        "joint_elasticity.joint2",
    ]
    assert made["values"] == {
        "sensor_drift.q_link.joint1.rate": 0.25,
        "kept": 1.0,
        "sensor_gain.q_link.joint1.error": 0.5,
        "sensor_bias.q_link.joint1.offset": 0.125,
        "joint_elasticity.joint2.stiffness": 100.0,
        "joint_elasticity.joint2.damping": 7.0,
    }
