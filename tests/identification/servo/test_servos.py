"""Servos as a source: what it says of recordings by another engine, and that a kind is one folder."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from lugre_servo import ARM, GRAVITY, LENGTH, MASS, STEP, LugreServo, recordings

import snarelab
from snarelab.errors import InputError
from snarelab.identification.servo.source import EVERY, WIDE, Servos, plain, start
from snarelab.identification.sources.decide import decide
from snarelab.identification.sources.fit import linearised
from snarelab.identification.sources.own import fitted, known, settled
from snarelab.identification.sources.source import GridPoint, Source
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.servo_loop import simulate

USUAL = {
    "servo_drive.torque_per_volt": 0.1,
    "servo_drive.back_emf": 0.3,
    "servo_drive.zero": 0.0,
    "rotor_inertia.inertia": 1e-3,
    "viscous_friction.coefficient": 0.01,
    "coulomb_friction.level": 0.01,
}
GIVEN = start("servo", [PlacedEffect(get_effect(x), "servo") for x in ("viscous_friction", "coulomb_friction")], USUAL)
NO_FILE: Any = SimpleNamespace(values={})
"""A model file without values."""


def placed(name):
    return PlacedEffect(get_effect(name), "servo")


@pytest.fixture(scope="module")
def clean():
    return Servos("servo", *recordings(LugreServo()))


def test_every_member_of_a_source_is_there(clean):
    for name in (x for x in dir(Source) if not x.startswith("_")):
        assert hasattr(clean, name), name


def test_a_kind_is_its_folder_and_no_other_edit():
    """Neither fit, search and confirmation nor any other kind knows of the servo."""
    root = Path(snarelab.__file__).parent
    own = root / "identification" / "servo"
    lines = sum(len(x.read_text(encoding="utf-8").splitlines()) for x in own.glob("*.py"))
    assert 150 <= lines <= 300
    for path in (root / "identification").rglob("*.py"):
        if own not in path.parents:
            text = path.read_text(encoding="utf-8")
            assert "servo_loop" not in text, path
            assert "Servos" not in text, path


def test_the_model_as_given_is_simulated_on_means_of_windows(clean):
    run = clean.runs[0]
    q = simulate(run, USUAL)
    own = clean.predicted(0, GIVEN)
    assert own.shape == clean.measured(0).shape
    k = 17
    rows = (run.time >= k * EVERY - 1e-9) & (run.time < (k + 1) * EVERY - 1e-9)
    assert own[k, 0] == pytest.approx(q[rows].mean(), abs=1e-12)
    assert plain({"a.servo.b": 1.0}) == {"a.b": 1.0}


def test_a_usual_size_is_a_share_of_the_load(clean):
    """Load-dependent friction of that size, along the motion, is that share; so is weight at the encoder's zero."""
    load = np.concatenate([MASS * GRAVITY * LENGTH * np.sin(clean.runs[i].position) for i in clean.train])
    size = WIDE * np.sqrt(np.mean(load**2))
    p = placed("load_dependent_friction")
    assert clean.size(p, p.effect.parameters[0]) == pytest.approx(WIDE, rel=0.02)
    drive, rotor = GIVEN.placed[:2]
    assert clean.size(drive, drive.effect.parameters[2]) == pytest.approx(size / (MASS * GRAVITY * LENGTH), rel=1e-6)
    assert clean.size(rotor, rotor.effect.parameters[0]) == pytest.approx(WIDE * ARM, rel=1e-6)


def test_a_column_is_the_change_of_the_simulation(clean):
    p = placed("load_dependent_friction")
    key = f"{p.key}.coefficient"
    (column,) = clean.columns(0, GIVEN, [GridPoint(p, {}, (key,))])
    moved = clean.predicted(0, GIVEN.with_effects([p], {key: WIDE}))
    assert column[:, :, 0] == pytest.approx((moved - clean.predicted(0, GIVEN)) / WIDE, rel=0.1, abs=0.05)


def test_a_law_that_the_motor_can_stand_for_is_no_candidate(clean):
    """(1 + driving) / k and (1 - braking) / k are all that positions say of a gear's losses and torque per volt k."""
    names = {p.effect.name for p in clean.library(GIVEN.placed)}
    assert {"load_dependent_friction", "stribeck_friction", "torque_ripple"} <= names
    assert not {"gear_efficiency", "makkar_friction", "coulomb_friction"} & names
    values = {**USUAL, "servo_drive.zero": 0.0, "load_dependent_friction.coefficient": 0.37}
    k = (1 + 0.6) / (1 + 0.37)
    other = {x: v * k for x, v in USUAL.items()}
    other |= {"servo_drive.back_emf": USUAL["servo_drive.back_emf"], "gear_efficiency.driving_loss": 0.6}
    other["gear_efficiency.braking_loss"] = 1 - (1 - 0.37) * k
    one, two = simulate(clean.runs[0], values), simulate(clean.runs[0], other)
    # Inertia is the pendulum's and does not scale: the two agree where it is slow.
    assert np.std(one - two) < 0.05 * np.std(one)


def test_without_recordings_and_where_it_cannot_be_simulated(clean):
    with pytest.raises(InputError, match="none is given"):
        Servos("servo", [])
    assert str(clean.refused(0)).startswith("seed 0: ")


def test_the_encoders_steps_are_noise_everywhere(clean):
    linear = linearised(clean, [0], GIVEN)
    ((channel,),) = clean.noise_channels([0], linear, [[np.zeros((len(clean.measured(0)), 0))]])
    assert channel.level * channel.sticks[0].min() == pytest.approx(STEP / np.sqrt(12), rel=0.01)
    assert channel.sticks[0].max() == 1.0


@pytest.mark.slow
def test_the_motor_is_found_from_positions(clean):
    """Torque per volt, inertia and friction; back-EMF and viscous friction only together, with a drive always on."""
    _, here = fitted(clean, known(NO_FILE, GIVEN), GIVEN)
    found, true = plain(here.at.all_values), LugreServo()
    k = found["servo_drive.torque_per_volt"]
    assert k == pytest.approx(true.torque_per_volt, rel=0.03)
    assert found["rotor_inertia.inertia"] == pytest.approx(true.rotor, abs=0.03 * (ARM + true.rotor))
    assert found["coulomb_friction.level"] == pytest.approx(true.level, rel=0.1)
    damping = k * found["servo_drive.back_emf"] + found["viscous_friction.coefficient"]
    assert damping == pytest.approx(true.torque_per_volt * true.back_emf + true.viscous, rel=0.05)


CONCEALED = (
    ({}, None, None),
    ({"load_share": 0.3}, "load_dependent_friction", ("coefficient", 0.3)),
    ({"ripple": 0.03}, "torque_ripple", ("sine", 0.03)),
    ({"drag": 0.004}, "quadratic_friction", ("coefficient", 0.004)),
)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "name", "value"), CONCEALED)
def test_a_concealed_law_is_named_and_a_clean_servo_is_adequate(law, name, value):
    source = Servos("servo", *recordings(LugreServo(**law)))
    found = decide(source, settled(source, NO_FILE, GIVEN))
    assert [n.placed.effect.name for n in found.best.names] == ([name] if name else [])
    if value:
        values = plain(found.best.last.train.at.all_values)
        assert values[f"{name}.{value[0]}"] == pytest.approx(value[1], rel=0.15)
        before, after = (np.std(np.concatenate(x.residuals)) for x in (found.before, found.best.last.held))
        assert after < 0.2 * before
