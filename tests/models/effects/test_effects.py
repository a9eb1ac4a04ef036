"""One contract for every effect found in models/effects."""

import re
from pathlib import Path

import pytest
from effect_contract import check_derivatives, check_dissipation, check_metadata, check_recovery, check_zero
from effect_references import REFERENCES

import snarelab.models.effects
from snarelab.errors import InputError
from snarelab.models.effect import written_unit
from snarelab.models.effects import FAMILIES, effects, get_effect

VOCABULARY = """
viscous_friction coulomb_friction asymmetric_friction stribeck_friction makkar_friction quadratic_friction
load_dependent_friction position_dependent_friction presliding_hysteresis joint_elasticity backlash torque_ripple
rotor_inertia link_torsion link_bending payload_mass com_offset inertia_error harness_stiffness slide_friction
sling_tension_error suspension_sway hang_point_clearance external_torque flexible_appendage propellant_slosh
wheel_friction contact_friction contact_damping contact_stiffness cable_damping cable_pretension umbilical_stiffness
sensor_bias sensor_drift sensor_gain sensor_delay carriage_friction docking_friction groove_misalignment latch_play
preload_loss gear_efficiency command_delay motor_saturation heating_friction end_stop joint_spring suspension_stiffness
"""
LAWS = {law: e for name, e in effects().items() for law, e in ((name, e), (f"{name} elsewhere", e.elsewhere)) if e}
"""Every law by its effect's name; one that holds on trees without the effect's kind of place under a name more."""
NAMES = list(LAWS)


def reference_of(name):
    if name not in REFERENCES:
        pytest.fail(
            f"effect '{name}' has no reference: add REFERENCES['{name}'] to tests/helpers/effect_references.py, a "
            "Reference(truth, output) whose output does without the effect's law (closed form, solve_ivp, theorem)"
        )
    return REFERENCES[name]


@pytest.mark.parametrize("name", NAMES)
def test_metadata_is_complete(name):
    assert LAWS[name].name in re.split(r"\s+", VOCABULARY)
    assert name.removesuffix(" elsewhere") == LAWS[name].name
    check_metadata(LAWS[name])


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_agree_with_finite_differences(name):
    check_derivatives(LAWS[name])


@pytest.mark.parametrize("name", NAMES)
def test_zero_amplitude_equals_baseline(name):
    check_zero(LAWS[name])


@pytest.mark.parametrize("name", [name for name in NAMES if LAWS[name].dissipates])
def test_friction_never_feeds_energy_in(name):
    check_dissipation(LAWS[name])


@pytest.mark.parametrize("name", NAMES)
def test_recovers_parameters_from_data_it_did_not_generate(name):
    check_recovery(LAWS[name], reference_of(name))


def test_effect_without_reference_says_what_to_add():
    with pytest.raises(
        pytest.fail.Exception, match=r"add REFERENCES\['new_effect'\] to tests/helpers/effect_references.py"
    ):
        reference_of("new_effect")


@pytest.mark.parametrize(
    ("unit", "joint", "channel", "written"),
    [
        ("T*s/S", "revolute", "", "N*m*s/rad"),
        ("T*s/S", "prismatic", "", "N*s/m"),
        ("1/T", "revolute", "", "1/(N*m)"),
        ("1/T", "prismatic", "", "1/N"),
        ("U", "revolute", "tau.joint1", "N*m"),
        ("U", "prismatic", "q_link.slide", "m"),
    ],
)
def test_units_are_written_out_for_a_kind_of_joint(unit, joint, channel, written):
    assert written_unit(unit, joint, channel) == written


def test_members_are_the_files_in_order_of_family():
    folder = Path(snarelab.models.effects.__path__[0])
    assert sorted(effects()) == sorted(path.stem for path in folder.glob("[!_]*.py"))
    families = [FAMILIES.index(effect.family) for effect in effects().values()]
    assert families == sorted(families)


def test_unknown_effect_names_the_nearest_and_all():
    assert get_effect("torque_ripple").name == "torque_ripple"
    assert (get_effect("torque_ripple_2").name, get_effect("torque_ripple_2").law) == (
        "torque_ripple_2",
        get_effect("torque_ripple").law,
    )
    for none in ("torque_ripple_1", "torque_ripple_10", "torque_ripple_x", "viscous_friction_2"):
        with pytest.raises(InputError, match="unknown effect"):
            get_effect(none)
    with pytest.raises(InputError) as caught:
        get_effect("columb_friction")
    message = str(caught.value)
    assert "'columb_friction'" in message
    assert "nearest: coulomb_friction" in message
    assert all(name in message for name in effects())
    assert "\n" not in message
