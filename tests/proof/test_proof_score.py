"""The proof's score, met by hand-made answers."""

from dataclasses import replace

import pytest
from proof_answers import RIGHT, answer, diagnosis, finding, several

from proof.cases import Truth
from proof.judge import judge
from proof.misses import explained
from proof.score import score
from proof.statistics import calibration_error, clopper_pearson


@pytest.mark.parametrize(
    ("given", "found", "name", "place"),
    [
        (answer(), diagnosis(RIGHT), True, True),
        (answer(), diagnosis(finding("harness_stiffness", "joint1")), True, False),
        (answer(), diagnosis(finding("sensor_bias", "tau.joint2")), False, False),
        (answer(), diagnosis(RIGHT, finding("torque_ripple", "joint1")), False, False),
        (answer(), diagnosis(), False, False),
        # One class with the truth, and not.
        (
            answer(),
            diagnosis(finding("com_offset", "link2", 0.6, [("harness_stiffness", "joint2", 0.3, False)])),
            True,
            True,
        ),
        (
            answer(),
            diagnosis(finding("com_offset", "link2", 0.6, [("harness_stiffness", "joint2", 0.3, True)])),
            False,
            False,
        ),
        (answer(name="sensor_gain", at="tau.joint2"), diagnosis(finding("sensor_gain", "tau.joint2")), True, True),
    ],
)
def test_name_and_place(given, found, name, place):
    case = judge(given, found)
    assert (case.name, case.place) == (name, place)
    assert bool(explained(case, found)) == (not (name and place))


def test_two_parts_stand_for_the_whole_and_one_does_not():
    whole = answer(name="makkar_friction", also=("viscous_friction", "coulomb_friction", "stribeck_friction"))
    parts = [finding(n, "joint2") for n in ("viscous_friction", "coulomb_friction")]
    assert judge(whole, diagnosis(*parts)).name
    assert not judge(whole, diagnosis(parts[0])).name
    assert not judge(whole, diagnosis(parts[0], finding("viscous_friction", "joint1"))).name


def test_pair_wants_both():
    pair = replace(answer("pair"), truths=(Truth("harness_stiffness", "joint2"), Truth("sensor_bias", "tau.joint1")))
    assert not judge(pair, diagnosis(RIGHT)).name
    assert judge(pair, diagnosis(RIGHT, finding("sensor_bias", "tau.joint1"))).name


def test_closure_is_over_the_floor_where_the_effect_shows():
    assert judge(answer(), diagnosis(RIGHT)).closure == pytest.approx((1.0 - 0.55) / (1.0 - 0.5))
    assert judge(answer(), diagnosis(RIGHT, before=2.0, after=2.5)).closure == pytest.approx(-0.5 / 1.5)


def test_closure_is_over_the_oracle_where_there_is_one():
    """Floor 0.5: the oracle of 1.1 floors leaves 0.55, as the diagnosis does; the other joint's counts for nothing."""
    oracle = {"tau.joint1": 3.0, "tau.joint2": 1.1}
    case = judge(answer(), diagnosis(RIGHT), oracle)
    assert case.closure == pytest.approx(1.0)
    assert case.closure_to_floor == pytest.approx((1.0 - 0.55) / (1.0 - 0.5))
    assert judge(answer(), diagnosis(RIGHT, before=1.0, after=0.9), oracle).closure == pytest.approx(0.1 / 0.45)
    # Nothing to close, and it stayed so; and did not.
    assert judge(answer(), diagnosis(RIGHT, before=0.56, after=0.55), oracle).closure == 1.0
    assert judge(answer(), diagnosis(RIGHT, before=0.56, after=0.7), oracle).closure == 0.0


def test_figures_by_hand():
    figures = score(*several()).figures
    expected = {
        "false_alarms": 0.25,
        "unknown_recall": 0.5,
        "not_blamed": 0.5,
        "name_at_0.5x": 0.0,
        "name_at_1x": 1.0,
        "name_at_2x": 1.0,
        "place": 1.0,
        "first_name": 0.75,
        "closure_median": 0.9,
        "error_returns": 1.0,
        # Five claims of 0.9 or so, of which three are right and three are not; one of 0.25, wrong.
        "calibration_error": (6 * abs(3 / 6 - 0.9) + 1 * 0.25) / 7,
    }
    assert {name: figures[name].value for name in expected} == pytest.approx(expected)
    assert figures["false_alarms"].count == 4
    assert figures["pairs"].value is None
    assert figures["false_alarms"].met is False
    assert figures["name_at_2x"].met is True


def test_method_that_names_nothing_has_no_false_alarms_to_count():
    figures = score([answer("clean", size=0.0), answer()], [diagnosis(verdict="none")] * 2).figures
    assert figures["false_alarms"].value is None
    assert figures["name_at_2x"].value == 0.0


def test_exact_interval_of_none_in_twenty():
    low, high = clopper_pearson(0, 20)
    assert low == 0.0
    assert high == pytest.approx(1.0 - 0.025 ** (1 / 20))
    assert clopper_pearson(20, 20) == pytest.approx((0.025 ** (1 / 20), 1.0))


def test_calibration_error_is_nothing_where_frequencies_are_the_probabilities():
    assert calibration_error([0.75] * 4, [1, 1, 1, 0]) == pytest.approx(0.0)
    assert calibration_error([1.0, 1.0], [1, 0]) == pytest.approx(0.5)


def test_numbers_that_were_right_and_are_said_to_be_wrong_are_counted():
    """Of an arm of two joints: a mass and a rotor each, less those where something is concealed."""
    mass, rotor = finding("inertia_error", "link1"), finding("rotor_inertia", "joint1")
    assert judge(answer(), diagnosis(RIGHT)).moved == (False, False)
    assert judge(answer(), diagnosis(RIGHT, mass)).moved == (True, False)
    assert judge(answer(), diagnosis(mass, rotor)).moved == (True, True)
    # Where something else may stand in its place, it is not said; where a parameter is wrong, none is right.
    either = finding("inertia_error", "link1", 0.6, [("sensor_gain", "tau.joint1", 0.3, False)])
    assert judge(answer(), diagnosis(either)).moved == (False, False)
    assert judge(answer("clean", size=0.0), diagnosis(rotor)).moved == (False, False, True, False)
    assert judge(answer("wrong", "link too light"), diagnosis(mass)).moved == ()
    shares = score([answer(), answer("clean", size=0.0)], [diagnosis(RIGHT, mass), diagnosis()]).figures["right_moved"]
    assert (shares.value, shares.count) == (pytest.approx(1 / 6), 6)
    silent = score([answer()], [diagnosis(verdict="none")]).figures["right_moved"]
    assert silent.value is None


def test_values_of_right_names_are_held_against_what_was_concealed():
    """Of a stiffness of 1: told as 1.3 and as -0.9, at a deviation of 0.1; at a bound, elsewhere or without one not."""

    def told(value, std: float | None = 0.1, at="joint2", **more):
        stiffness = {"value": value, "std": std, **more}
        return diagnosis(
            RIGHT | {"at": at, "parameters": {"stiffness": stiffness, "torque_at_zero": {"value": 9.0, "std": 0.1}}}
        )

    assert judge(answer(), told(1.3)).deviations == pytest.approx([3.0])
    assert judge(answer(), told(-0.9)).deviations == pytest.approx([-1.0])
    for none in (told(1.3, at_bound=True), told(1.3, std=None), told(1.3, at="joint1"), diagnosis(RIGHT)):
        assert judge(answer(), none).deviations == ()
    figure = score([answer()] * 3, [told(1.3), told(-0.9), diagnosis()]).figures["coverage"]
    assert (figure.value, figure.count, figure.met) == (0.5, 2, False)
