"""A floating base in a recording, by hand: names, what acts from outside, wheels, the carriers' motion, and noise."""

from dataclasses import replace
from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest
import xarray as xr
from moving_arm import exact
from scipy.spatial.transform import Rotation

from snarelab.errors import InputError
from snarelab.identification.fitting.floating_terms import (
    as_carriers,
    base_signals,
    momentum_floor,
    outside,
    told,
    twist_noise,
    wheel_impulse,
    with_base,
    with_twist,
)

N = 6
TIME = 0.5 * np.arange(N)
AXES = "xyz"


def tree(body="base", link="hub") -> Any:
    joints = [Made(name=f"carrier{k}") for k in range(6)]
    return Made(body=body, joints=[*joints, Made(name="shoulder")], links=[*(5 * [Made(name="")]), Made(name=link)])


def recorded(*bodies, **signals):
    """Bodies at rest, and signals by name with a point written as two underscores."""
    columns = {}
    for body in bodies:
        columns |= {f"{kind}.{body}.{a}": np.zeros(N) for kind in ("vel", "omega") for a in AXES}
        columns |= {f"quat.{body}.{a}": np.full(N, float(a == "w")) for a in "wxyz"}
    columns |= {name.replace("__", "."): np.array(x, float) for name, x in signals.items()}
    data = {name: ("time", np.resize(x, N)) for name, x in columns.items()}
    return xr.Dataset(data, coords={"time": TIME}, attrs={"path": "run.csv", "notes": ["as it came"]})


@pytest.mark.parametrize(
    ("bodies", "named", "taken"),
    [
        (("hub",), "base", "hub"),
        (("hub", "target"), "base", "hub"),  # of two the one called as the model's link
        (("target",), "base", "target"),  # the only one
        (("target", "other"), "base", None),
        (("base", "hub"), "base", None),  # it has the model's own name
        (("hub",), "other", None),  # the model says which
        ((), "base", None),
    ],
)
def test_the_base_is_the_body_of_its_link_or_the_only_one(bodies, named, taken):
    data = recorded(*bodies, q__shoulder=[1.0])
    found = with_base(data, tree(named))
    if taken is None:
        assert found is data
        return
    assert {f"vel.base.{a}" for a in AXES} <= set(map(str, found))
    assert not [name for name in found if f".{taken}." in str(name)]
    assert "q.shoulder" in found
    assert found.attrs["notes"] == [
        "as it came",
        f"the base is taken to be {taken!r}; give 'base' in the model file to say so",
    ]


def test_a_body_without_its_whole_twist_is_no_base():
    data = recorded("hub", "target").drop_vars("omega.hub.z")
    assert "vel.base.x" in with_base(data, tree())  # the target is the only whole one
    assert with_base(recorded("hub").drop_vars("vel.hub.y"), tree()).attrs["notes"] == ["as it came"]


def test_force_and_moment_from_outside_are_zero_where_they_are_not_recorded():
    data = recorded(force__base__y=[2.0], torque__base__z=np.arange(N))
    found = outside(data, tree())
    np.testing.assert_array_equal(found[:, 1], np.full(N, 2.0))
    np.testing.assert_array_equal(found[:, 5], np.arange(N))
    assert not found[:, [0, 2, 3, 4]].any()


def test_what_wheels_were_told_adds_up_and_may_not_be_missing():
    """A torque of t about z has given t²/2; half a second apart trapezia are exact."""
    data = recorded(torque__wheels__z=TIME)
    np.testing.assert_array_equal(told(data), np.stack([0 * TIME, 0 * TIME, TIME], 1))
    motion: Any = Made(time=np.array([0.0, 0.5, 2.0]))
    np.testing.assert_allclose(wheel_impulse(data, motion)[:, 2], [0.0, 0.125, 2.0])
    data["torque.wheels.z"][3] = np.nan
    data["torque.wheels.y"] = ("time", np.zeros(N))
    with pytest.raises(InputError, match=r"^run\.csv: torque\.wheels\.z is missing at t = 1\.5 s"):
        told(data)


def test_the_twist_stands_in_the_bases_own_axes_and_wheels_add_to_the_moment():
    """Turned by a quarter about z, the world's y is the base's x and the world's x its -y. Wheels: 3 about the base's
    x for t, which has given 3 t, and ω × 3t e_x = 3t (0, ω_z, -ω_y)."""
    signals = {f"quat__base__{a}": [x] for a, x in zip("wxyz", (np.sqrt(0.5), 0, 0, np.sqrt(0.5)), strict=True)}
    signals |= {"vel__base__x": [1.0], "vel__base__y": [2.0], "omega__base__x": [0.3], "omega__base__z": [0.4]}
    signals |= {"torque__wheels__x": [3.0], "torque__base__y": [10.0], "force__base__z": [7.0]}
    found = with_twist(recorded("base", **signals), tree())
    twist = np.stack([found[f"q.carrier{k}"].values for k in range(6)], 1)
    np.testing.assert_allclose(twist, np.tile([2.0, -1.0, 0.0, 0.0, -0.3, 0.4], (N, 1)), atol=1e-12)
    wrench = np.stack([found[f"tau.carrier{k}"].values for k in range(6)], 1)
    given = 3 * TIME
    wanted = np.stack([0 * TIME, 0 * TIME, 7 + 0 * TIME, 3 + 0 * TIME, 10 + 0.4 * given, 0.3 * given], 1)
    np.testing.assert_allclose(wrench, wanted, atol=1e-12)
    with pytest.raises(InputError, match=r"^run\.csv: no signal 'omega\.base\.y' of the floating base"):
        with_twist(recorded("base", **signals).drop_vars("omega.base.y"), tree())


def carried(segments=None) -> Any:
    """A motion of a base and one joint whose q is the twist and qd its rate."""
    rng = np.random.default_rng(1)
    samples = (TIME, *rng.normal(size=(4, N, 7)))
    motion = exact(tuple(f"j{k}" for k in range(7)), 0.5, 1, samples, segments)
    return replace(motion, encoder_noise=np.arange(1.0, 22.0).reshape(3, 7))


def test_carriers_at_zero_move_as_the_twist_says():
    """The carriers translate in the world and then turn about x, y, z: near zero the attitude is
    R = Rx(a) Ry(b) Rz(c); its spin in its own axes, and its velocity, give the twist and the twist's rate."""
    motion = carried()
    found = as_carriers(motion)
    assert not found.q[:, :6].any()
    np.testing.assert_array_equal(found.q[:, 6], motion.q[:, 6])
    np.testing.assert_array_equal(found.qd[:, 6], motion.qd[:, 6])
    np.testing.assert_array_equal(found.qdd[:, 6], motion.qdd[:, 6])
    np.testing.assert_array_equal(found.encoder_noise[:, :6], 0.0)
    np.testing.assert_array_equal(found.encoder_noise[:, 6], motion.encoder_noise[:, 6])
    h = 1e-4

    def at(k, t):
        place, angles = (found.qd[k, s] * t + found.qdd[k, s] * t**2 / 2 for s in (slice(0, 3), slice(3, 6)))
        return place, Rotation.from_euler("XYZ", angles)

    def twist(k, t):
        (before, turned), (after, turns) = at(k, t - h), at(k, t + h)
        own = at(k, t)[1]
        velocity = own.inv().apply((after - before) / (2 * h))
        return np.concatenate([velocity, (turned.inv() * turns).as_rotvec() / (2 * h)])

    for k in range(N):
        np.testing.assert_allclose(twist(k, 0.0), motion.q[k, :6], atol=1e-6)
        np.testing.assert_allclose((twist(k, h) - twist(k, -h)) / (2 * h), motion.qd[k, :6], atol=1e-3)


def test_noise_of_the_twist_from_fourth_differences():
    """Of ±1 in turn they are ±16, which white noise of variance 256/70 would make; a cubic has none."""
    signals = {f"q__carrier{k}": (TIME**3 if k else [1.0, -1.0]) for k in range(6)}
    np.testing.assert_allclose(twist_noise(recorded(**signals), tree()), [256 / 70, 0, 0, 0, 0, 0], atol=1e-20)
    rng = np.random.default_rng(0)
    white = xr.Dataset({f"q.carrier{k}": ("time", (k + 1) * rng.normal(size=20000)) for k in range(6)})
    white["q.carrier2"][100] = np.nan
    np.testing.assert_allclose(twist_noise(white, tree()), np.arange(1, 7) ** 2, rtol=0.06)


def test_the_floor_of_the_momentum_balance_is_that_of_a_derivative_through_the_inertia():
    """White noise of unit variance at 100 Hz, up to 5 Hz: density 0.02, and (2π)² 0.02 · 5³ / 3 for the derivative;
    a mass of 2 on the first axis, and 3 across from the second."""
    inertia = np.zeros((4, 7, 7))
    inertia[:, 0, 0], inertia[:, 1, 2] = 2.0, [2.0, 4.0, 2.0, 4.0]
    motion = Made(period=0.01, band=5.0)
    e: Any = Made(motion=motion, store={"twist_noise": np.array([1.0, 1, 4, 1, 1, 1])}, mass_matrix=inertia)
    derivative = 2 * np.pi * np.sqrt(0.02 * 125 / 3)
    np.testing.assert_allclose(momentum_floor(e), derivative * np.array([2.0, 3.0 * 2.0, 0, 0, 0, 0]))


def test_what_a_law_at_the_base_reads():
    motion = carried((slice(0, 2), slice(2, N)))
    e: Any = Made(motion=as_carriers(motion), impulse=None, elapsed=TIME)
    found = base_signals(e)
    spin, velocity = motion.q[:, 3:6], motion.q[:, :3]
    np.testing.assert_array_equal(found["spin"], spin)
    np.testing.assert_array_equal(found["spin_gained"], np.concatenate([spin[:2] - spin[0], spin[2:] - spin[2]]))
    np.testing.assert_allclose(found["spin_rate"], motion.qd[:, 3:6], atol=1e-12)
    # In its own axes the origin's acceleration is the velocity's rate and ω × v.
    np.testing.assert_allclose(found["acceleration"], motion.qd[:, :3] + np.cross(spin, velocity), atol=1e-12)
    assert not found["impulse"].any()
    assert found["impulse"].shape == (N, 3)
    e.impulse = np.ones((N, 3))
    assert base_signals(e)["impulse"] is e.impulse
    assert base_signals(e)["time"] is TIME
