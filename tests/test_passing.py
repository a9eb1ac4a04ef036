"""What passes a screening, and in which order: each bar on both sides, samples near rest, drives, and twins."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest

from snarelab.identification.search.passing import all_passing
from snarelab.models.effects import get_effect
from snarelab.models.model import Placed

JOINTS = ("joint1", "joint2")
SURE, UNSURE = np.full(20, 0.5), np.tile([1.0, -1.0], 10)
"""Gains on blocks left out: the same on every one, and as often lost as gained."""

IN_MOTION, NEAR_REST, AS_MEASURED = "samples in motion", "samples near rest", "motion as measured"


def judged(
    name,
    at="joint1",
    score=20.0,
    near_rest=0.0,
    *,
    explained=0.5,
    channels=(0,),
    samples=IN_MOTION,
    gains=SURE,
):
    """A candidate with what the samples say of it; ``near_rest`` is its score with samples near rest, too."""
    case = Made(evidence=samples, fresh_gains=lambda: gains)
    placed = Placed(get_effect(name), at)
    return Made(
        placed=placed,
        score=score,
        explained=explained,
        channels=channels,
        case=case,
        signal=lambda: name,
        among=lambda samples: Made(score=near_rest, samples=samples),
    )


def passing(candidates, worth: float = 0.05, heard=(0.0, 0.0), asked=(), alike=(), likeness=0.99) -> Any:
    """Names of what passes, in order; noise reaches 7 on either channel, 9 on both together."""
    screened: Any = Made(
        judged=candidates,
        threshold={(0,): 7.0, (1,): 7.0, (0, 1): 9.0, (1, 0): 9.0},
        worth={c.placed.key: worth for c in candidates},
        heard=np.array(heard),
        measured=Made(evidence=AS_MEASURED),
        near_rest=Made(evidence=NEAR_REST),
        asked={c.placed.key: c for c in asked},
        evidence=Made(likeness=lambda a, b: likeness if {a, b} <= set(alike) else 0.0),
    )
    return [c.placed.effect.name for c in all_passing(screened, JOINTS)]


@pytest.mark.parametrize(
    ("what", "passes"),
    [
        ({"score": 7.0}, False),  # noise reaches as much
        ({"score": 7.001}, True),
        ({"score": 8.9, "channels": (0, 1)}, False),
        ({"score": 9.1, "channels": (0, 1)}, True),
        ({"explained": 0.05}, True),  # just worth a name
        ({"explained": 0.0499}, False),
        ({"gains": UNSURE}, False),
    ],
)
def test_a_candidate_passes_every_test_or_not_at_all(what, passes):
    assert passing([judged("viscous_friction", **what)]) == (["viscous_friction"] if passes else [])


@pytest.mark.parametrize(
    ("name", "at", "heard", "worth", "least"),
    [
        ("sensor_delay", "q.joint2", 0.1, 0.05, 0.1),  # what a disturbance may drive of the motion
        ("sensor_delay", "q.joint2", 0.1, 0.3, 0.3),
        ("sensor_delay", "tau.joint2", 0.1, 0.05, 0.2),  # 0.05 + 1.5 * 0.1, noise heard on its own channel
        ("sensor_delay", "tau.joint2", 0.02, 0.05, 0.1),  # 0.05 + 1.5 * 0.02 is less than that
        ("sensor_gain", "tau.joint2", 0.1, 0.05, 0.05),  # it is not late
        ("joint_elasticity", "joint2", 0.1, 0.05, 0.05),  # no sensor
    ],
)
def test_a_late_sensor_must_explain_more_than_what_passes_for_one(name, at, heard, worth, least):
    for explained, passes in ((least + 1e-9, True), (least - 1e-3, False)):
        found = passing([judged(name, at, explained=explained, channels=(1,))], worth, (0.7, heard))
        assert bool(found) is passes


@pytest.mark.parametrize(
    ("first", "second", "order"),
    [
        # Scores of the two that were judged in motion once samples near rest count: 30 is to be beaten.
        (35.0, 25.0, ["viscous_friction", "stribeck_friction", "quadratic_friction"]),
        (29.0, 31.0, ["viscous_friction", "quadratic_friction", "stribeck_friction"]),
        (29.0, 25.0, ["stribeck_friction", "viscous_friction", "quadratic_friction"]),
        (30.0, 30.0, ["stribeck_friction", "viscous_friction", "quadratic_friction"]),  # no more than itself
    ],
)
@pytest.mark.parametrize("place", [0, 1, 2])
def test_one_judged_near_rest_goes_behind_what_beats_it_on_its_own_samples(first, second, order, place):
    several = [judged("viscous_friction", score=40.0, near_rest=first)]
    several += [judged("quadratic_friction", score=20.0, near_rest=second)]
    several.insert(place, judged("stribeck_friction", score=30.0, samples=NEAR_REST))
    assert passing(several) == order


def test_only_what_reaches_the_same_channels_is_compared_near_rest():
    ahead = judged("viscous_friction", "joint2", 50.0, 99.0, channels=(1,))
    rest = judged("stribeck_friction", score=30.0, samples=NEAR_REST)
    assert passing([ahead, rest]) == ["stribeck_friction", "viscous_friction"]
    both = judged("payload_mass", score=50.0, near_rest=99.0, channels=(1, 0))
    assert passing([both, judged("com_offset", score=30.0, channels=(0, 1), samples=NEAR_REST)]) == [
        "payload_mass",
        "com_offset",
    ]


def test_two_judged_near_rest_compare_by_the_scores_that_they_have():
    one = judged("stribeck_friction", score=25.0, near_rest=99.0, samples=NEAR_REST)
    other = judged("makkar_friction", score=30.0, near_rest=0.0, samples=NEAR_REST)
    assert passing([one, other]) == ["makkar_friction", "stribeck_friction"]


def spring(score=30.0, samples=AS_MEASURED, at="joint1"):
    return judged("joint_elasticity", at, score, channels=(0, 1), samples=samples)


@pytest.mark.parametrize(
    ("of_spring", "asked", "beside", "found"),
    [
        # Along the motion that was asked for it passes, does not, or was not judged.
        (spring(), [judged("joint_elasticity", score=9.5, channels=(0, 1))], (0,), ["joint_elasticity", "a gain"]),
        (spring(), [judged("joint_elasticity", score=8.5, channels=(0, 1))], (0,), ["a gain"]),
        (spring(), [], (0,), ["a gain"]),
        # What else there is acts on another joint's channel than that of the spring's own joint.
        (spring(), [], (1,), ["a gain", "joint_elasticity"]),
        (spring(at="joint2"), [], (1,), ["a gain"]),
        (spring(at="joint2"), [], (0,), ["a gain", "joint_elasticity"]),
        # It was not judged along the motion as measured.
        (spring(samples=IN_MOTION), [], (0,), ["joint_elasticity", "a gain"]),
    ],
)
def test_a_spring_that_disturbances_could_have_driven_is_named_where_nothing_else_is(of_spring, asked, beside, found):
    gain = judged("sensor_gain", "tau.joint1", 20.0, channels=beside)
    names = {"sensor_gain": "a gain"}
    several = [of_spring, gain]
    keys = {c.placed.key: 0.05 for c in several}
    assert len(keys) == 2
    assert [names.get(name, name) for name in passing(several, asked=asked)] == found


def test_friction_judged_along_the_motion_as_measured_is_no_drive():
    """A torque is driven by no noise of the motion; only a drive's spring or play passes along what was measured."""
    friction = judged("viscous_friction", score=30.0, samples=AS_MEASURED)
    assert passing([friction, judged("sensor_gain", "tau.joint1")]) == ["viscous_friction", "sensor_gain"]


TWINS = ("harness_stiffness", "rotor_inertia", "sensor_gain")


@pytest.mark.parametrize(
    ("second", "scores", "near_rest", "likeness", "swapped"),
    [
        ("rotor_inertia", (20.0, 18.5), (2.0, 5.0), 0.99, True),  # near rest says more for the second
        ("rotor_inertia", (20.0, 18.5), (2.0, 3.5), 0.99, True),  # a little more: nothing else orders them
        ("rotor_inertia", (20.0, 18.5), (3.5, 2.0), 0.99, False),
        ("rotor_inertia", (20.0, 18.0), (2.0, 9.0), 0.99, False),  # a score that says something
        ("rotor_inertia", (20.0, 18.5), (2.0, 9.0), 0.98, False),  # not alike enough
        ("sensor_gain", (20.0, 18.5), (3.5, 2.0), 0.99, True),  # a sensor is ruled out first
        ("sensor_gain", (20.0, 18.5), (4.0, 2.0), 0.99, False),  # unless it is the worse one near rest by two
        ("sensor_gain", (20.0, 18.5), (4.0, 2.1), 0.99, True),
    ],
)
def test_twins_stand_in_the_order_of_what_they_explain_near_rest(second, scores, near_rest, likeness, swapped):
    at = "tau.joint1" if second == "sensor_gain" else "joint1"
    pair = [judged(TWINS[0], "joint1", scores[0], near_rest[0]), judged(second, at, scores[1], near_rest[1])]
    found = passing(pair, alike=TWINS, likeness=likeness)
    assert found == ([second, TWINS[0]] if swapped else [TWINS[0], second])


def test_a_twin_goes_before_its_like_and_past_what_stands_between():
    between = judged("viscous_friction", score=19.0, near_rest=30.0)
    first, last = judged(TWINS[0], "joint1", 20.0, 2.0), judged(TWINS[1], "joint1", 18.5, 5.0)
    ahead = judged("stribeck_friction", score=40.0, samples=NEAR_REST)
    found = passing([ahead, first, between, last], alike=TWINS)
    assert found == ["stribeck_friction", TWINS[1], TWINS[0], "viscous_friction"]


def test_what_acts_on_another_channel_or_was_judged_near_rest_is_no_twin():
    here = judged(TWINS[0], "joint1", 20.0, 2.0)
    there = judged(TWINS[1], "joint2", 19.0, 9.0, channels=(1,))
    assert passing([here, there], alike=TWINS) == [TWINS[0], TWINS[1]]
    rest = judged(TWINS[1], "joint1", 1e9, 9.0, samples=NEAR_REST)
    weak = judged(TWINS[0], "joint1", 2e9, 2e9)
    assert passing([weak, rest], alike=TWINS) == [TWINS[0], TWINS[1]]
