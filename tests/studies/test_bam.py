"""The servo study (BAM, XL330): the publishers' recordings, and what the study says of them."""

import numpy as np
import pytest
from real_recordings import real_recordings

from snarelab.errors import InputError
from snarelab.identification.servo.source import plain
from snarelab.studies import bam
from snarelab.studies.bam_recordings import HELD_OUT, duty_error, position_error, read_run


def test_damaged_recording_is_named(tmp_path):
    path = tmp_path / "broken.json"
    path.write_text('{"kp": 100, "entries": []}')
    with pytest.raises(InputError, match=r"broken\.json: is no recording of the servo"):
        read_run(path)


@pytest.fixture(scope="module")
def recorded():
    """All runs: those to fit, and those at gain 400."""
    runs = [read_run(path) for path in sorted(real_recordings("bam/xl330", "*.json").glob("*.json"))]
    return [r for r in runs if r.kp != HELD_OUT], [r for r in runs if r.kp == HELD_OUT]


def test_duty_is_what_the_firmware_makes_of_it(recorded):
    assert len(recorded[0]) == 12
    assert duty_error([*recorded[0], *recorded[1]]) < 0.01  # a sample's lag of a moving joint; full duty is 1


@pytest.mark.slow
def test_load_dependence_is_named_and_takes_a_quarter_of_the_held_out_error(recorded):
    source, decided = bam.decided_on(*recorded)
    (found,) = bam.findings(source, decided)
    assert found.name == "load_dependent_friction"
    assert 0.5 < found.probability < 0.99
    first, last = bam.steps(source, decided)
    assert first["holdout"] == pytest.approx(bam.CHECK["coulomb_and_viscous"], rel=0.1)
    assert last["holdout"] < bam.CHECK["load_dependent_friction"]
    assert last["holdout"] / first["holdout"] == pytest.approx(0.75, abs=0.03)
    assert last["holdout"] == pytest.approx(position_error(recorded[1], plain(decided.train.at.all_values)))
    assert np.isfinite(
        [q.ours for q in bam.numbers(source, decided, [first, last]) if not isinstance(q.ours, str)]
    ).all()
    assert found.name.replace("_", " ") in bam.sentence(decided, [first, last])
