"""What moves inside a floating base: Drake's sloshing mass, pendulum and reaction wheels, named and measured."""

import numpy as np
import pytest

from bench.drake_servicer import Tank, Wheel, model, record
from snarelab.errors import InputError
from snarelab.identification.diagnose import diagnose
from snarelab.identification.identify import identify
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.recordings import read_recording, write_recording

PLACE = (-0.4, 0.3, 0.5)


def named(folder, name, **inside):
    """The only effect that a diagnosis names, by its parameters, and the fits."""
    train, held = (record(folder / f"{k}.csv", k, **inside) for k in (1, 2))
    found = diagnose(model(folder), [train], held).diagnosis
    assert [(e.name, e.at) for e in found.effects] == [(name, "base")]
    return {key: p.value for key, p in found.effects[0].parameters.items()}, found.fit


def identified(folder, name, **inside):
    believed = model(folder).with_effects([PlacedEffect(get_effect(name), "base")], {})
    found = identify(believed, [record(folder / "1.csv", 1, **inside)]).to_json()
    return {p["name"]: p for p in found["parameters"]}


@pytest.mark.slow
def test_propellant_slosh_is_named(tmp_path):
    got, fits = named(tmp_path, "propellant_slosh", tank=Tank(40.0, PLACE, 0.25, 0.05))
    # The bar is 15 %; what is seen is below 1 %, since the law leaves nothing out.
    np.testing.assert_allclose([got[f"mass_{a}"] for a in "xyz"], 40.0, rtol=0.01)
    np.testing.assert_allclose([got[a] for a in "xyz"], PLACE, atol=0.01)
    assert got["frequency"] == pytest.approx(0.25, rel=0.01)
    assert got["damping"] == pytest.approx(0.05, rel=0.05)
    assert all(f.holdout.relative_after < 0.02 for f in fits if "base" in f.channel)


@pytest.mark.slow
def test_mass_that_slides_along_one_axis(tmp_path):
    got = identified(tmp_path, "propellant_slosh", tank=Tank(40.0, PLACE, 0.3, 0.05, axes="y"))
    np.testing.assert_allclose([got[f"mass_{a}"]["value"] for a in "xyz"], [0, 40, 0], atol=0.4)
    np.testing.assert_allclose([got[a]["value"] for a in "xyz"], PLACE, atol=0.01)


def test_pendulum_sloshes_across_its_length(tmp_path):
    got = identified(tmp_path, "propellant_slosh", tank=Tank(40.0, PLACE, 0.3, 0.05, pendulum=0.6))
    np.testing.assert_allclose([got[f"mass_{a}"]["value"] for a in "xyz"], [40, 40, 0], atol=6)
    assert got["frequency"]["value"] == pytest.approx(0.3, rel=0.02)


@pytest.mark.slow
def test_far_below_its_frequency_only_mass_over_frequency_squared_shows(tmp_path):
    """Motion of 0.1 to 0.2 Hz, slosh at 3 Hz: what shows is mass / w² times a fourth derivative, and no more."""
    got = identified(tmp_path, "propellant_slosh", tank=Tank(40.0, PLACE, 3.0, 0.3))
    mass, frequency = got["mass_y"], got["frequency"]
    assert mass["value"] / frequency["value"] ** 2 == pytest.approx(40.0 / 9.0, rel=0.15)
    assert min(x["std"] / x["value"] for x in (mass, frequency)) > 0.03  # neither is known to 1 % any more


@pytest.mark.slow
def test_driven_wheel_is_named(tmp_path):
    wheel = Wheel(2, inertia=0.1, viscous=2e-3, coulomb=0.01, torque=0.2)
    got, _ = named(tmp_path, "wheel_friction", wheel=wheel)
    assert got["loss_z"] == pytest.approx(0.02, rel=0.05)
    assert got["coulomb_z"] == pytest.approx(0.01, rel=0.05)
    np.testing.assert_allclose([got["coulomb_x"], got["coulomb_y"]], 0.0, atol=5e-4)


def test_idle_wheel_is_dragged_along(tmp_path):
    got = identified(tmp_path, "wheel_friction", wheel=Wheel(2, inertia=3.0, viscous=0.3, coulomb=5e-3))
    for name, true in {"loss_z": 0.1, "coulomb_z": 5e-3, "inertia": 3.0}.items():
        assert got[name]["value"] == pytest.approx(true, rel=0.15)


def test_wheel_without_friction_leaves_nothing_over(tmp_path):
    """Its momentum turns with the base: left out, that alone is 0.1 N·m, or 4 % of a channel."""
    path = record(tmp_path / "1.csv", 1, wheel=Wheel(2, inertia=0.1, viscous=0.0, coulomb=0.0, torque=0.2))
    fits = identify(model(tmp_path), [path]).to_json()["fit"]
    assert all(fits[f"torque.hub.{a}"]["train"]["relative"] < 4e-3 for a in "xyz")


def test_wheels_need_every_sample(tmp_path):
    path = record(tmp_path / "1.csv", 1, wheel=Wheel(2, inertia=0.1, viscous=0.0, coulomb=0.0, torque=0.2))
    recording = read_recording(path)
    recording["torque.wheels.z"][7] = np.nan
    write_recording(recording, path)
    with pytest.raises(InputError, match=r"torque.wheels.z is missing at t = [0-9.]+ s; wheels keep all"):
        identify(model(tmp_path), [path])
