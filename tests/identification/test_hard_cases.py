"""Arms of the proof's generator, from a seed for work on the tool, that a diagnosis once missed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from proof.cases import ROUND, draw, planned_cases
from proof.judge import judge
from proof.run import gained
from snarelab.identification.diagnose import diagnose
from snarelab.identification.fitting.experiment import load_experiments, scales
from snarelab.identification.search.candidates import candidate_columns, variants
from snarelab.identification.search.refit import assemble
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model
from snarelab.models.rigid_body import RigidBody

SEED = 90200
BUNDLED = Path(__file__).resolve().parents[2] / "studies" / "bundled"


def recorded(number, folder, seed=SEED):
    """A case, written into the folder."""
    plan = planned_cases(len(ROUND), seed)[number]
    for attempt in range(20):
        try:
            case = draw(plan, seed, number, attempt)
            case.write(folder)
            return case.answer
        except ValueError:  # an arm that cannot be recorded
            continue
    raise AssertionError(f"case {number} of {seed} cannot be recorded")


def diagnosed(number, folder, seed=SEED):
    """Of one case: what is concealed in it, and the diagnosis."""
    answer = recorded(number, folder, seed)
    return answer, diagnose(load_model(folder / "arm.toml"), [folder / "train.csv"], folder / "hold.csv").diagnosis


def judged(number, folder, seed=SEED):
    """Of one case: what is concealed in it, the diagnosis, and the judgement by a recording that nothing else sees."""
    answer = recorded(number, folder, seed)
    made = diagnose(load_model(folder / "arm.toml"), [folder / "train.csv"], folder / "hold.csv")
    found = made.diagnosis
    save_model(made.model, folder / "found.toml", found.sentence)
    third = {"third": gained(folder, folder / "found.toml", found.band)}
    return answer, found, judge(answer, found.to_json() | third)


@pytest.mark.slow
def test_named_and_nothing_else(tmp_path):
    """One block gains thirty times what the others do."""
    answer, found, judgement = judged(63, tmp_path / "case")
    assert answer.kinds == ("quadratic_friction",)
    assert judgement.name, found.sentence
    assert judgement.place


@pytest.mark.slow
def test_bristles_under_a_disturbance_are_told_beside_the_level_they_carry(tmp_path):
    """Most of what Coulomb friction leaves is the disturbance: they explain a fifth of it, which is all the excess."""
    answer, found, judgement = judged(41, tmp_path / "case", 90300)
    assert answer.kinds == ("coulomb_friction",)
    (joint,) = {truth.at for truth in answer.truths}
    assert {(e.name, e.at) for e in found.effects} == {("coulomb_friction", joint), ("presliding_hysteresis", joint)}
    error = judgement.error
    assert error
    assert error[1] < 1.05  # times the disturbance and the noise


@pytest.mark.slow
def test_bristles_under_load_are_told_near_rest_too(tmp_path):
    """Friction by load is most of what the joint's bristles carry: where they were taken to slip after the same travel
    whatever the load, 40 % of the error was closed."""
    answer, found, judgement = judged(110, tmp_path / "case", 90500)
    assert answer.kinds == ("load_dependent_friction",)
    (joint,) = {truth.at for truth in answer.truths}
    assert [(e.name, e.at) for e in found.effects] == [("load_dependent_friction", joint)]
    error = judgement.error
    assert error
    assert error[0] > 2.0  # much is concealed on this recording
    assert error[1] < 1.05  # times the disturbance and the noise


@pytest.mark.slow
def test_a_cable_that_hardens_is_a_harness_and_more(tmp_path):
    """Most of it is no spring's: what the spring leaves stands beside it, without a name. A stop may be named for the
    end of the travel, where the cable is taut, but it is not the whole either."""
    answer, found = diagnosed(66, tmp_path / "case", 90300)
    assert answer.kinds == ("hardening cable",)
    (channel,) = answer.channels
    assert {e.name for e in found.effects} <= {"harness_stiffness", "end_stop"}
    assert f"on {channel}, a smooth curve over position" in found.description
    # A table takes that part: it is in the model, and the names stay names.
    assert {t.at for t in found.empirical} == {channel.removeprefix("tau.")}
    last, before = found.steps[-1], found.steps[-2]
    assert last.label.startswith("+ empirical")
    assert last.holdout < before.holdout


@pytest.mark.slow
def test_bursts_are_an_effect_without_a_name(tmp_path):
    """Four times the disturbance's RMS, at times that no state of the arm goes with."""
    answer, found = diagnosed(9, tmp_path / "case")
    assert answer.kinds == ("bursts of vibration",)
    assert found.verdict == "unknown_effect", found.sentence
    (channel,) = answer.channels
    assert f"on {channel}" in found.description
    assert "bursts" in found.description
    assert found.location[0].channel == channel


@pytest.mark.slow
def test_what_only_stands_in_for_an_effect_without_a_name_is_not_named(tmp_path):
    """Friction by position passes on the held-out recording, but not beside the nameless curves over the place."""
    answer, found = diagnosed(126, tmp_path / "case", 90400)
    assert answer.kinds == ("one-way seal",)
    assert found.verdict == "unknown_effect", found.sentence
    (channel,) = answer.channels
    assert f"missing on {channel}" in found.sentence
    assert "smooth curve over position" in found.description
    assert {e.name for e in found.effects} <= {"empirical"}


@pytest.mark.slow
def test_of_twins_the_likelier_is_told_and_the_other_beside_it(tmp_path):
    """In motion a torque sensor's bias and friction that differs by direction explain the same to the last digits."""
    _, found = diagnosed(8, tmp_path / "case", 90401)
    bias = next(e for e in found.effects if e.at == "tau.joint4")
    twin = next(r for r in bias.rivals if r.name == "asymmetric_friction")
    assert bias.name == "sensor_bias"
    assert not twin.separable
    assert bias.probability > twin.probability


def test_a_candidate_with_fewer_amplitudes_has_its_own_columns():
    """They were those of all amplitudes where these had been worked out before, and the diagnosis ended in a fault."""
    model = load_model(BUNDLED / "arm3.toml")
    (experiment,) = load_experiments(model, [BUNDLED / "train.csv"], RigidBody(model.tree))
    assembly = assemble(model, None, scales([experiment]))
    state = assembly.evaluate(experiment, assembly.start)
    whole = variants(assembly, PlacedEffect(get_effect("asymmetric_friction"), model.joints[0]))[0]
    one = replace(whole, amplitudes=whole.amplitudes[:1], low=whole.low[:1], high=whole.high[:1])
    (_, every), (_, single) = (candidate_columns(assembly, experiment, state, v)[0] for v in (whole, one))
    assert every.shape[1] == 2
    np.testing.assert_array_equal(single, every[:, :1])
