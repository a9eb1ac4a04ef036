"""Whole decisions and answers on simulations that are straight lines over the effects' values, with noise."""

from typing import Any

import numpy as np
import pytest
from captures_by_hand import DAMPING, FRICTION, PRETENSION, STIFFNESS, Straight, along, captures_of, key_of, model_of

from snarelab.identification.snare.answer import report_on, with_found
from snarelab.identification.snare.source import start
from snarelab.identification.sources.decide import decide
from snarelab.models.snare.setup import SnareTree

N = 40
T = 0.25 * np.arange(N)
TOUCH = 50
"""Times of a track before the cables touch."""


def course(shape):
    """Of a target that is moved once the cables touch, along y (metres for each unit)."""
    return along(*((0.0, x if t >= 2.5 else 0.0, 0.0) for t, x in zip(T, shape, strict=True)))


PATH = along(*((0.0, 0.02 * np.sin(0.9 * t), 0.02 * np.sin(0.9 * t + 1.0)) for t in T))
COURSES = {
    key_of(FRICTION): course(0.05 * np.sin(2.0 * T)),
    key_of(PRETENSION): course(1e-5 * np.exp(-T / 3) * np.cos(3.0 * T)),
    key_of(DAMPING): course(2.0 * np.cos(1.1 * T)),
    key_of(STIFFNESS): course(100.0 * np.sin(1.7 * T)),
}
FACTOR = {key_of(DAMPING): lambda x: x - 1e-3, key_of(STIFFNESS): lambda k: k ** (-2 / 3)}


def setup_of(model):
    assert isinstance(model.tree, SnareTree)
    return model.tree.setup


def no_contact(values):
    """Without stiffness there is none, which cannot be simulated."""
    return values.get(key_of(STIFFNESS), 1.0) <= 0


def decided(values, *, model=None, more: Any = 0.0, seed=0, law=None):
    """What two captures say whose truth has these values, and some motion beside that no simulation has."""
    rng = np.random.default_rng(seed)
    runs = Straight(PATH, COURSES, law or FACTOR, no_contact, touch=TOUCH)
    truth = runs.one(values).position + more
    own = [truth + 1e-4 * rng.normal(size=truth.shape) for _ in range(2)]
    source = captures_of(runs, *own, model=model)
    return source, decide(source, start(source.model, len(source.records)))


def test_what_was_left_out_is_named_with_its_value_and_saved():
    source, found = decided({key_of(FRICTION): 0.15})
    assert [n.placed.key for n in found.best.names] == [FRICTION.key]
    said = report_on(source, found, 3.2)
    assert said.verdict == "missing_physics"
    (effect,) = said.effects
    value = effect.parameters["coefficient"]
    assert value.value == pytest.approx(0.15, abs=max(3 * value.std, 1e-3))
    assert 0 < value.std < 0.01
    assert said.sentence.startswith("The model leaves out contact friction at pin. With that added, the error of pos.")
    assert "The cables rub on the pin" in effect.evidence
    assert [s.label for s in said.steps] == ["model as given", "+ contact_friction at pin"]
    assert said.steps[1].holdout < 0.3 * said.steps[0].holdout
    assert {f.channel for f in said.fit} == {f"pos.target.{a}" for a in "xyz"}
    assert said.location[0].channel == "pos.target.y"
    assert [(t.recording, t.role) for t in said.traces[::3]] == [("0.csv", "train"), ("1.csv", "holdout")]
    assert "captures were simulated in 3 s" in said.notes[-1]
    after = with_found(source.model, found.best.last.train.at)
    assert [p.key for p in after.effects] == [FRICTION.key]
    assert after.values[key_of(FRICTION)] == value.value


@pytest.mark.parametrize("seed", range(4))
def test_a_model_that_misses_nothing_is_adequate_and_says_what_would_have_shown(seed):
    source, found = decided({}, seed=seed)
    said = report_on(source, found, 1.0)
    assert (said.verdict, said.effects, said.description) == ("adequate", (), "")
    assert said.sentence.startswith("The model is adequate")
    limits = {x.name: x.value for x in said.limits}
    assert 0 < limits["contact_friction"] < 0.15
    assert len(said.steps) == 1
    # A contact that would have shown is softer than steel.
    assert limits["contact_stiffness"] < 1e9


def test_damping_of_a_rope_within_what_is_known_of_it_is_no_name():
    """Twice the set-up's, which is known to its own size; ten times is told."""
    assert [n.placed.key for n in decided({key_of(DAMPING): 2e-3})[1].best.names] == []
    assert [n.placed.key for n in decided({key_of(DAMPING): 1e-2})[1].best.names] == [DAMPING.key]


def test_a_contact_that_gives_way_is_named_with_its_stiffness():
    """Between the points where it is tried, 2e6 and 3e5."""
    _, found = decided({key_of(STIFFNESS): 7e5})
    assert [n.placed.key for n in found.best.names] == [STIFFNESS.key]
    assert found.best.last.train.at.all_values[key_of(STIFFNESS)] == pytest.approx(7e5, rel=0.05)


def test_a_held_out_capture_is_simulated_with_what_was_named_only():
    """Each simulation costs seconds. A rope's damping is a shift, which has its column everywhere."""
    runs: Any = decided({key_of(FRICTION): 0.15})[0].runs
    asked = list(zip(runs.numbers, runs.asked[-len(runs.numbers) :], strict=True))
    assert {k for n, values in asked if n == 0 for k in values} >= set(COURSES)
    assert {k for n, values in asked if n == 1 for k in values} == {key_of(FRICTION), key_of(DAMPING)}


def test_two_effects_are_both_named():
    _, found = decided({key_of(FRICTION): 0.15, key_of(PRETENSION): 600.0})
    assert {n.placed.key for n in found.best.names} == {FRICTION.key, PRETENSION.key}
    assert found.best.last.train.at.all_values[key_of(PRETENSION)] == pytest.approx(600.0, rel=0.1)


def test_motion_that_no_effect_explains_is_told_as_such():
    """The target is drawn along z as the ring closes."""
    source, found = decided({}, more=along(*((0.0, 0.0, 4e-3 * np.sin(0.6 * t)) for t in T)))
    said = report_on(source, found, 1.0)
    assert (said.verdict, said.effects) == ("unknown_effect", ())
    assert "of pos.target.z" in said.description
    assert said.description.endswith("check the set-up's sizes and masses")
    assert said.sentence.startswith("Something is missing that no effect of the vocabulary explains")


def test_a_number_that_the_file_does_not_give_is_corrected_and_is_no_missing_physics():
    mass = "mass.capture.value"
    said_mass = setup_of(model_of(())).target.mass
    courses, laws = {**COURSES, mass: course(1e-3 * np.sin(1.4 * T))}, {**FACTOR, mass: lambda x: x - said_mass}
    runs = Straight(PATH, courses, laws, no_contact, touch=TOUCH)
    rng = np.random.default_rng(1)
    truth = runs.one({mass: said_mass + 5.0}).position
    own = [truth + 1e-4 * rng.normal(size=truth.shape) for _ in range(2)]
    source = captures_of(runs, *own, model=model_of(()))
    found = decide(source, start(source.model, len(source.records)))
    said = report_on(source, found, 1.0)
    assert said.effects == ()
    assert said.verdict == "adequate"
    (moved,) = said.moved
    assert (moved.name, moved.unit, moved.before) == ("capture.mass", "kg", said_mass)
    assert moved.after == pytest.approx(said_mass + 5.0, abs=3 * moved.std + 0.1)
    assert "Numbers of the set-up that the model file does not give fit better as mass = " in said.sentence
    after = with_found(source.model, found.best.last.train.at)
    assert after.effects == ()
    assert setup_of(after).target.mass == moved.after
    assert setup_of(after).given["mass"] == moved.after


def test_values_that_the_model_had_are_told_before_and_after():
    model = model_of(effects=[FRICTION], values={key_of(FRICTION): 0.1})
    source, found = decided({key_of(FRICTION): 0.13}, model=model)
    said = report_on(source, found, 1.0)
    (moved,) = said.moved
    assert (moved.name, moved.before) == (key_of(FRICTION), 0.1)
    assert moved.after == pytest.approx(0.13, abs=3 * moved.std)
