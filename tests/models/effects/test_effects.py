"""One contract for every effect found in models/effects."""

import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pytest
from effect_references import (
    REFERENCES,
)
from effect_signals import DT, TIME, signals
from scipy.optimize import least_squares

import snarelab.models.effects
from snarelab.errors import InputError
from snarelab.models.effect import written_unit
from snarelab.models.effects import FAMILIES, effects, get_effect
from snarelab.models.hidden_state import THROUGH, LawEvaluation, evaluate_law

VOCABULARY = """
viscous_friction coulomb_friction asymmetric_friction stribeck_friction makkar_friction quadratic_friction
load_dependent_friction position_dependent_friction presliding_hysteresis joint_elasticity backlash torque_ripple
rotor_inertia link_torsion link_bending payload_mass com_offset inertia_error harness_stiffness slide_friction
sling_tension_error suspension_sway hang_point_clearance external_torque flexible_appendage propellant_slosh
wheel_friction contact_friction contact_damping contact_stiffness cable_damping cable_pretension umbilical_stiffness
sensor_bias sensor_drift sensor_gain sensor_delay carriage_friction docking_friction groove_misalignment latch_play
preload_loss gear_efficiency motor_saturation heating_friction end_stop joint_spring suspension_stiffness
"""
NAMES = list(effects())


def reference_of(name):
    if name not in REFERENCES:
        pytest.fail(
            f"effect '{name}' has no reference: add REFERENCES['{name}'] to tests/helpers/effect_references.py, a "
            "Reference(truth, output) whose output does without the effect's law (closed form, solve_ivp, theorem)"
        )
    return REFERENCES[name]


def scale_of(parameter, s):
    travel, torque = np.ptp(s["q"]), np.abs(s["value" if parameter.unit == "U" else "load"]).max()
    scales = {"": 1.0, "speed": s["speed_scale"][0], "travel": travel, "torque": torque, "rate": torque / travel}
    scales |= {"per_torque": 1 / torque, "place": travel}  # the motion's middle is near zero
    return scales[parameter.relative_to]


def draw(parameter, s, rng):
    """A random value inside the bounds."""
    if np.isfinite(parameter.high):
        low = max(parameter.low, 1e-3 * parameter.high)
        return scale_of(parameter, s) * np.exp(rng.uniform(*np.log([low, parameter.high])))
    drawn = rng.normal()
    return drawn if drawn > parameter.low else abs(drawn)


def evaluate(effect, s, parameters) -> LawEvaluation:
    return evaluate_law(effect, s, np.asarray(parameters), dt=DT)


def baseline(effect, s):
    """What stands where the effect acts, without it."""
    return s[THROUGH[effect.at]].reshape(TIME.size, -1) if effect.at in ("link", "sensor") else 0.0


def rms(rows):
    return np.sqrt(np.mean(rows**2, axis=0))


def fit(effect, s, measured, keep):
    """Best start on the shapes' grid with the amplitudes by linear least squares, then a nonlinear refinement."""
    spread = rms(measured - baseline(effect, s)) + 1e-9
    scales = np.array([scale_of(parameter, s) for parameter in effect.parameters])
    low = np.array([parameter.low for parameter in effect.parameters]) * scales
    high = np.array([parameter.high for parameter in effect.parameters]) * scales
    amplitudes = np.array([not parameter.grid for parameter in effect.parameters])

    def residual(p):
        return ((evaluate(effect, s, p).values - measured) / spread)[keep].ravel()

    def slope(p):
        return (evaluate(effect, s, p).by_parameter / spread[:, None])[keep].reshape(-1, p.size)

    starts = []
    for shape in itertools.product(*(parameter.grid or (0.0,) for parameter in effect.parameters)):
        start = np.array(shape) * scales
        if amplitudes.any():
            start[amplitudes] -= np.linalg.lstsq(slope(start)[:, amplitudes], residual(start))[0]
        start = np.clip(start, low, high)
        starts.append((np.sum(residual(start) ** 2), tuple(start)))
    how: dict[str, Any] = {"jac": slope, "bounds": (low, high), "x_scale": "jac", "xtol": 1e-10}
    return least_squares(residual, min(starts)[1], **how).x


@pytest.mark.parametrize("name", NAMES)
def test_metadata_is_complete(name):
    effect = effects()[name]
    assert name in re.split(r"\s+", VOCABULARY)
    assert effect.family in FAMILIES
    assert min(len(effect.sentence), len(effect.equation)) > 10
    assert effect.experiment.format(at="joint3").count("joint3") == effect.experiment.count("{at}") > 0
    assert set(effect.contains) <= set(NAMES) - {name}
    assert re.search(r"\(.*(\d{4}|eq).*\)|\d{4}", effect.source)
    assert bool(effect.states) == bool(effect.rate)
    units = pint.UnitRegistry()
    for parameter in effect.parameters:
        assert parameter.meaning
        for torque, position in (("(N*m)", "rad"), ("N", "m")):
            spelled = {"T": torque, "S": position, "U": "(N*m)"}
            units.parse_units(re.sub(r"\b[TSU]\b", lambda match, by=spelled: by[match[0]], parameter.unit))
        assert all(parameter.low <= number <= parameter.high for number in (*parameter.grid, parameter.zero))
        assert list(parameter.grid) in (sorted(parameter.grid), sorted(parameter.grid, reverse=True))
        assert not parameter.relative_to or parameter.grid


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_agree_with_finite_differences(name):
    effect, s, rng = effects()[name], signals(), np.random.default_rng(11)
    through = THROUGH.get(effect.at, "")
    for _ in range(4):
        p = np.array([draw(parameter, s, rng) for parameter in effect.parameters])
        result = evaluate(effect, s, p)
        for i in range(p.size):
            step = 1e-5 * max(abs(p[i]), 1e-3) * np.eye(p.size)[i]
            change = (evaluate(effect, s, p + step).values - evaluate(effect, s, p - step).values) / (2 * step[i])
            size = np.abs(change).max(axis=0) + 1e-6 * np.abs(result.values).max(axis=0) / max(abs(p[i]), 1e-3)
            assert np.all(np.abs(result.by_parameter[:, :, i] - change) <= 2e-5 * size + 1e-12)
        if result.by_signal is None:
            continue
        for i in range(result.by_signal.shape[2]) if not effect.states else ():
            step = 1e-6 * (np.eye(10)[i] if effect.at == "link" else 1.0)
            ahead, behind = (evaluate(effect, s | {through: s[through] + sign * step}, p) for sign in (1, -1))
            change = (ahead.values - behind.values) / 2e-6
            np.testing.assert_allclose(result.by_signal[:, :, i], change, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_zero_amplitude_equals_baseline(name):
    effect, s, rng = effects()[name], signals(), np.random.default_rng(12)
    elastic = effect.acts_on == "position"  # vanishes as the stiffness grows, not at zero
    p = [draw(parameter, s, rng) if parameter.zero else 0.0 for parameter in effect.parameters]
    if elastic:
        p[0] = 1e14
    result = evaluate(effect, s, p).values
    np.testing.assert_allclose(result, np.broadcast_to(baseline(effect, s), result.shape), rtol=0, atol=1e-6)
    if not elastic:
        p = [draw(parameter, s, rng) for parameter in effect.parameters]
        assert np.abs(evaluate(effect, s, p).values - baseline(effect, s)).max() > 1e-3


@pytest.mark.parametrize("name", [name for name in NAMES if effects()[name].dissipates])
def test_friction_never_feeds_energy_in(name):
    effect, s, rng = effects()[name], signals(), np.random.default_rng(13)
    s = s | {"qd": np.sign(s["qd"]) * 10 ** rng.uniform(-7, 1.5, TIME.size), "load": rng.normal(size=TIME.size)}
    for _ in range(50):
        p = np.array([draw(parameter, s, rng) for parameter in effect.parameters])
        power = s["qd"] * evaluate(effect, s, p).values[:, 0]
        assert power.min() >= -1e-12 * power.max()
        assert power.max() > 0


@pytest.mark.parametrize("name", NAMES)
def test_recovers_parameters_from_data_it_did_not_generate(name):
    effect, s, rng = effects()[name], signals(), np.random.default_rng(14)
    reference = reference_of(name)
    truth = [reference.truth[parameter.name] for parameter in effect.parameters]
    clean = reference.output(s, *reference.truth.values()).reshape(TIME.size, -1)
    keep = s["time"] >= reference.settle
    size = rms(clean - baseline(effect, s))
    sharp = keep & (np.abs(s["qd"]) > 0.005 * s["speed_scale"])  # where a smooth sign equals a sign
    assert np.all(rms((evaluate(effect, s, truth).values - clean)[sharp]) <= reference.likeness * size)
    measured = clean + 0.01 * size * rng.normal(size=clean.shape)
    np.testing.assert_allclose(fit(effect, s, measured, keep), truth, rtol=reference.tolerance)


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
    assert sorted(NAMES) == sorted(path.stem for path in folder.glob("[!_]*.py"))
    families = [FAMILIES.index(effects()[name].family) for name in NAMES]
    assert families == sorted(families)


def test_unknown_effect_names_the_nearest_and_all():
    assert get_effect("torque_ripple").name == "torque_ripple"
    with pytest.raises(InputError) as caught:
        get_effect("columb_friction")
    message = str(caught.value)
    assert "'columb_friction'" in message
    assert "nearest: coulomb_friction" in message
    assert all(name in message for name in NAMES)
    assert "\n" not in message
