"""Arms of the proof's generator, from a seed for work on the tool, that a diagnosis once missed."""

import numpy as np
import pytest

from proof.cases import ROUND, draw, planned_cases
from proof.judge import judge
from snarelab.identification.diagnose import diagnose
from snarelab.identification.screening import reliably_positive
from snarelab.models.model_file import load_model

SEED = 90200


def diagnosed(number, folder):
    """Of one case: what is concealed in it, and the diagnosis."""
    plan = planned_cases(len(ROUND), SEED)[number]
    for attempt in range(20):
        try:
            case = draw(plan, SEED, number, attempt)
            case.write(folder)
            break
        except ValueError:  # an arm that cannot be recorded
            continue
    found = diagnose(load_model(folder / "arm.toml"), [folder / "train.csv"], folder / "hold.csv").diagnosis
    return case.answer, found


@pytest.mark.parametrize(
    ("number", "concealed"),
    [
        (36, "backlash"),  # the link's ringing in closed loop is not in the motion that was asked for
        (63, "quadratic_friction"),  # one block gains thirty times what the others do
    ],
)
def test_named_and_nothing_else(number, concealed, tmp_path):
    answer, found = diagnosed(number, tmp_path / "case")
    assert answer.kinds == (concealed,)
    assert judge(answer, found.to_json()).name, found.sentence
    assert judge(answer, found.to_json()).place


def test_bursts_are_an_effect_without_a_name(tmp_path):
    """Four times the disturbance's RMS, at times that no state of the arm goes with."""
    answer, found = diagnosed(9, tmp_path / "case")
    assert answer.kinds == ("bursts of vibration",)
    assert found.verdict == "unknown_effect", found.sentence
    (channel,) = answer.channels
    assert f"on {channel}" in found.description
    assert "bursts" in found.description
    assert found.location[0].channel == channel


def test_a_block_that_dwarfs_the_others_is_no_reason_to_doubt_them():
    gains = np.array([62.3, 59.1, 29.6, 18.5, 51.7, 34.5, 55.6, 66.2, 1527.0, 26.9, 45.9, 71.1, 81.5])
    assert reliably_positive(gains)
    assert not reliably_positive(-gains)
    mixed = np.array([-15.6, -17.4, -4.7, 46.6, -29.6, 0.2, -21.1, 67.4, -391.0, 18.8, -28.6, 2.5, 32.4])
    assert not reliably_positive(mixed)
