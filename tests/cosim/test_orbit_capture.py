"""What stands where when an arm arrives at its target, what is coupled to what, and what is read of a run: by hand."""

# pyright: reportArgumentType=false

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from snarelab.cosim.orbit_capture import (
    ALONG_TIP,
    JointResistance,
    OrbitCapture,
    arrival,
    capture_of,
    column,
    columns,
    resistance,
    step_control,
    system,
)
from snarelab.models.floating.dynamics import tip_jacobians, tip_pose
from snarelab.models.floating.space_arm import CAPTURE_POSE, FRICTION
from snarelab.models.snare.model import Accuracy
from snarelab.models.snare.parameters import SnareParameters

FOOT = np.array([0.12, 0.02, -0.03])
TURN = Rotation.from_euler("xyz", [0.02, -0.03, 0.04])
POSE = np.array([CAPTURE_POSE])


@pytest.mark.parametrize("case", ["inspection", "hover"])
def test_the_pin_stands_in_the_end_effectors_frame_where_it_was_told_to(case):
    start = arrival(case, FOOT, TURN, speed=0.02)
    effector = start.effector.rotation
    np.testing.assert_allclose(
        effector.T @ (np.array(start.target.position) - start.effector.position), FOOT, atol=1e-12
    )
    pin = Rotation.from_quat(start.target.orientation, scalar_first=True)
    np.testing.assert_allclose(effector.T @ pin.as_matrix(), TURN.as_matrix(), atol=1e-12)
    # The tip's own frame, turned: the end effector looks along the last link.
    bare = tip_pose(start.arm, POSE)
    np.testing.assert_allclose(effector, bare.rotation[0], atol=1e-12)
    assert (ALONG_TIP @ np.array([1.0, 0.0, 0.0])).tolist() == [0.0, 0.0, 1.0]
    assert start.arm.tip_rotation is ALONG_TIP
    assert (start.arm.mount is None) is (case == "hover")


@pytest.mark.parametrize("case", ["inspection", "hover"])
def test_the_joints_move_the_tip_along_its_axis_and_base_and_target_go_back_as_fast(case):
    """Seen from a base at rest the tip moves by 20 mm/s along its x; the world is where the tip rests."""
    start = arrival(case, FOOT, TURN, speed=0.02)
    along = start.effector.rotation[:, 0]
    twist = tip_jacobians(start.arm, POSE)[1][0] @ start.rates
    np.testing.assert_allclose(twist, [*(0.02 * along), 0.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(start.drift, [*(-0.02 * along), 0.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(start.target.velocity, -0.02 * along, atol=1e-12)
    assert np.linalg.matrix_rank(tip_jacobians(start.arm, POSE)[1][0]) == 6
    still = arrival(case, FOOT, TURN)
    assert not still.rates.any()
    assert not still.drift.any()


def test_a_floating_target_is_a_uniform_cube_of_ten_tonnes_with_the_pin_in_a_face():
    """m a²/6 about each axis, 10 t of 2 m: 6667 kg·m²; the middle is half a side away."""
    target = arrival("hover", FOOT, TURN).target
    assert (target.support, target.mass) == ("free", 1e4)
    np.testing.assert_allclose(np.asarray(target.inertia), np.diag([4e4 / 6] * 3), rtol=1e-12)
    np.testing.assert_allclose(target.centre_of_mass, [1.0, 0.0, 0.0])
    assert arrival("inspection", FOOT, TURN).target.support == "moved"


def test_friction_scales_as_a_whole_and_its_shape_stays():
    usual = FRICTION["coulomb_level"]
    twice = resistance(2 * usual, 40.0)
    levels = {"coulomb_level", "stribeck_level", "viscous_coefficient"}
    assert levels < set(FRICTION)
    assert dict(twice.friction) == pytest.approx({k: (2 if k in levels else 1) * v for k, v in FRICTION.items()})
    assert twice.stiffness == 40.0
    assert (dict(JointResistance().friction), JointResistance().stiffness, resistance(usual).stiffness) == (
        FRICTION,
        0.0,
        0.0,
    )


@pytest.mark.parametrize(("case", "bodies"), [("inspection", 2), ("hover", 1)])
def test_what_counts_as_an_error_is_told_for_each_body_that_is_coupled(case, bodies):
    """13 numbers of a frame and 6 of an impulse each."""
    control = step_control(arrival(case, FOOT, TURN))
    assert len(control.magnitudes) == 19 * bodies
    assert control.magnitudes["arm.pos.tip.x"] == control.magnitudes["arm.vel.tip.z"] == 0.01
    assert control.magnitudes["arm.omega.tip.y"] == control.magnitudes["arm.quat.tip.w"] == 0.02
    assert control.magnitudes["snare.impulse.effector.x"] == 10 * 2e-3
    assert ("snare.angular_impulse.pin.z" in control.magnitudes) is (bodies == 2)
    assert (control.tolerance, control.smallest, control.largest) == (3e-3, 2.5e-4, 4e-3)
    other = step_control(arrival(case, FOOT, TURN), 0.05, 16e-3)
    assert (other.tolerance, other.largest) == (0.05, 16e-3)


@pytest.mark.parametrize(("case", "bodies"), [("inspection", 2), ("hover", 1)])
@pytest.mark.parametrize("stiffness", [0.0, 500.0])
def test_frames_go_to_the_snare_and_impulses_to_the_arm_whose_motors_are_off(case, bodies, stiffness):
    start = arrival(case, FOOT, TURN, speed=0.02)
    coupled = system(start, resistance(30.0, stiffness), SnareParameters(), Accuracy(1e-3, 10, 5e-4))
    assert (coupled.name, list(coupled.participants)) == (case, ["snare", "arm"])
    links = {(c.source, c.target) for c in coupled.connections}
    pairs = [("tip", "effector"), ("mount", "pin")][:bodies]
    assert len(links) == 19 * bodies
    for arm, snare in pairs:
        for name in ("pos.{}.x", "quat.{}.w", "vel.{}.y", "omega.{}.z"):
            assert ("arm." + name.format(arm), "snare." + name.format(snare)) in links
        for kind in ("impulse", "angular_impulse"):
            assert (f"snare.{kind}.{snare}.z", f"arm.{kind}.{arm}.z") in links
    given = coupled.parameters_of("arm")
    assert given["servo.joint3.stiffness"] == stiffness
    assert given["servo.joint3.damping"] == 0.0
    assert given["makkar_friction.joint7.coulomb_level"] == pytest.approx(30.0)
    outputs = dict(zip(coupled.participants["arm"].names("output"), coupled.participants["arm"].outputs(), strict=True))
    np.testing.assert_allclose([outputs[f"q.joint{i}"] for i in range(1, 8)], CAPTURE_POSE, atol=1e-12)
    # The whole drifts with the base; the tip rests.
    np.testing.assert_allclose([outputs[f"vel.tip.{a}"] for a in "xyz"], 0.0, atol=1e-9)
    np.testing.assert_allclose([outputs[f"vel.base.{a}"] for a in "xyz"], start.drift[:3], atol=1e-9)


# What is read of a run

TIMES = np.array([0.0, 0.1, 0.2, 0.4])


def capture(**given):
    frame = np.zeros((4, 6, 3))
    frame[:, 3:] = np.eye(3)
    nothing = np.zeros((4, 3))
    fields = {"times": TIMES, "tip": frame, "pin": frame, "base": frame, "q": nothing, "qd": nothing,
              "impulse": nothing, "angular_impulse": nothing, "first_contact": None}  # fmt: skip
    return OrbitCapture(**{**fields, **given})


def test_the_pin_is_told_in_the_end_effectors_axes():
    """The end effector at (1, 0, 0), its x along the world's y: a pin at (1, 2, 0) is 2 m ahead of it."""
    tip, pin = np.zeros((4, 6, 3)), np.zeros((4, 6, 3))
    tip[:, 0] = [1.0, 0.0, 0.0]
    tip[:, 3:] = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    pin[:, 0] = [1.0, 2.0, 0.0]
    pin[3, 0] = [0.0, 0.0, 5.0]
    found = capture(tip=tip, pin=pin).relative
    np.testing.assert_allclose(found, [*[[2.0, 0.0, 0.0]] * 3, [0.0, 1.0, 5.0]], atol=1e-12)


@pytest.mark.parametrize(
    ("window", "every", "middles", "forces"),
    [
        (0.2, None, [0.1, 0.3], [10.0, 20.0]),
        (0.2, 0.1, [0.1, 0.2, 0.3], [10.0, 15.0, 20.0]),
        (0.1, 0.2, [0.05, 0.25], [10.0, 20.0]),
        (0.4, None, [0.2], [15.0]),
    ],
)
def test_a_mean_force_is_what_an_impulse_grew_by_over_the_window(window, every, middles, forces):
    """10 N for 0.2 s and then 20 N along x; along z a tenth of it, the other way."""
    gained = np.array([0.0, 1.0, 2.0, 6.0])
    found, mean = capture(impulse=np.outer(gained, [1.0, 0.0, -0.1])).mean_force(window, every)
    np.testing.assert_allclose(found, middles, atol=1e-12)
    np.testing.assert_allclose(mean, np.outer(forces, [1.0, 0.0, -0.1]), atol=1e-9)


def test_columns_are_found_by_their_names_without_the_unit():
    table = xr.Dataset({"a.x [N]": ("time", [1.0, 2.0]), "a.xy": ("time", [5.0, 6.0]), "a.y": ("time", [3.0, 4.0])})
    np.testing.assert_array_equal(column(table, "a.x"), [1.0, 2.0])
    np.testing.assert_array_equal(columns(table, "a", "yx"), [[3.0, 1.0], [4.0, 2.0]])


@pytest.mark.parametrize(("case", "body"), [("inspection", "mount"), ("hover", "pin")])
@pytest.mark.parametrize("touched", [None, 2])
def test_a_runs_columns_become_frames_joints_and_the_first_contact(case, body, touched):
    """Every column has a number of its own; the tip is turned by a quarter about z."""
    data, number = {}, 0.0
    names = [f"{k}.{b}.{a}" for b in ("tip", "pin", "mount", "base") for k in ("pos", "vel", "omega") for a in "xyz"]
    names += [f"{k}.joint{i}" for k in ("q", "qd") for i in range(1, 8)]
    names += [f"snare.{k}.effector.{a}" for k in ("impulse", "angular_impulse") for a in "xyz"]
    for name in names:
        number += 1.0
        data[name] = ("time", number + 0.01 * np.arange(4))
    turns = {"tip": [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]}
    for b in ("tip", "pin", "mount", "base"):
        for axis, value in zip("wxyz", turns.get(b, [1.0, 0.0, 0.0, 0.0]), strict=True):
            data[f"quat.{b}.{axis} [1]"] = ("time", np.full(4, value))
    for axis, sign in zip("xyz", (0.0, -1.0, 0.0), strict=True):
        push = np.where(np.arange(4) >= 2, 3.0 * sign, 0.0) if touched else np.zeros(4)
        data[f"force.pin.{axis}"] = ("time", push)
    table = xr.Dataset(data, coords={"time": TIMES})
    found = capture_of(SimpleNamespace(recording=table), case)

    def of(name):
        return data[name][1]

    np.testing.assert_array_equal(found.times, TIMES)
    for frame, name in ((found.tip, "tip"), (found.pin, body), (found.base, "base")):
        for row, kind in enumerate(("pos", "vel", "omega")):
            np.testing.assert_array_equal(frame[:, row], np.column_stack([of(f"{kind}.{name}.{a}") for a in "xyz"]))
    quarter = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    np.testing.assert_allclose(found.tip[:, 3:], [quarter] * 4, atol=1e-12)
    np.testing.assert_allclose(found.base[:, 3:], [np.eye(3)] * 4, atol=1e-12)
    np.testing.assert_array_equal(found.q[:, 6], of("q.joint7"))
    np.testing.assert_array_equal(found.qd[:, 0], of("qd.joint1"))
    assert found.q.shape == found.qd.shape == (4, 7)
    np.testing.assert_array_equal(found.impulse[:, 2], of("snare.impulse.effector.z"))
    np.testing.assert_array_equal(found.angular_impulse[:, 0], of("snare.angular_impulse.effector.x"))
    assert found.first_contact == (0.2 if touched else None)
