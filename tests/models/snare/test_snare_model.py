"""The whole snare: energy, momentum, macro steps, exact save and restore, and what it refuses."""

# pyright: reportArgumentType=false

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snarelab.errors import InputError
from snarelab.models.snare.drive import Pose
from snarelab.models.snare.model import Accuracy, SnareModel, SnareStepError
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.target import Target

QUICK = SnareParameters(ring_rate=np.deg2rad(40), friction=0.2)
"""A capture in two seconds instead of ten; first contact after half a second."""
STILL = np.zeros(3)


@pytest.fixture(scope="module")
def capture():
    model = SnareModel(QUICK, Target("free", mass=5.0, inertia=np.diag([0.05, 0.2, 0.2])))
    return model.run(2.0, every=0.01)


def test_ring_work_is_stored_or_lost(capture):
    e = capture.energies
    moved = np.max(np.abs(e["ring_work"]))
    assert np.max(np.abs(capture.energy_residual)) < 5e-3 * moved
    assert e["friction"][-1] > 1e-3  # it has rubbed, so that the balance is no empty statement
    assert np.all(np.diff(e["friction"]) >= 0)
    assert np.all(np.diff(e["damped"]) >= 0)


def test_impulse_on_the_pin_is_the_change_of_momentum(capture):
    """Free target: mean force on the effector, less what the light cables hold, against the target's momentum."""
    change = 5.0 * (capture.target_velocity[-1] - capture.target_velocity[0])
    impulse = np.cumsum(capture.mean_force * np.diff(capture.times, prepend=0)[:, None], axis=0)[-1]
    cables = 3 * QUICK.mass_per_length * QUICK.cable_length * 0.2  # moving at 0.2 m/s at most
    assert np.max(np.abs(change + impulse)) < cables
    assert np.linalg.norm(change) > 5 * cables


def test_capture_brings_the_target_inside(capture):
    radial = np.hypot(*capture.target_position[:, 1:].T)
    assert capture.first_contact == pytest.approx(0.58, abs=0.05)  # 2.60 s at a fifth of the rate, and the ramp
    assert radial.min() < 0.5 * radial[0]
    assert len(capture.contact_points) == len(capture.times) == len(capture.contact_forces)
    index = int(np.argmax([len(c) for c in capture.contact_points]))
    assert capture.pin_force[index] == pytest.approx(-capture.contact_forces[index].sum(axis=0), abs=1e-9)


def near_contact(**settings):
    """A model that stands shortly before its first contact with a target moved from outside."""
    rotation = Rotation.from_rotvec([0.02, 0.01, -0.02]).as_matrix()
    effector = Pose(np.array([12.0, -3.0, 5.0]), rotation, STILL, STILL)
    quaternion = np.roll(Rotation.from_matrix(rotation).as_quat(), 1)
    target = Target("moved", position=effector.position + rotation @ [0.2369, 0.0747, 0.0402], orientation=quaternion)
    return SnareModel(QUICK, target, effector=effector, **settings)


def same(a, b):
    vectors = zip(a.solver.vectors, b.solver.vectors, strict=True)
    return all(np.array_equal(x, y) for x, y in vectors) and np.array_equal(a.totals, b.totals)


def go(model, n_steps):
    for k in range(n_steps):
        pose = model.effector_pose()
        lift = np.array([0, 2e-6 * k, 0])
        model.move_effector(Pose(pose.position + lift, pose.rotation, 1e3 * lift, STILL))
        model.step(1e-3)
    return model.save()


def test_restore_and_repeat_is_bitwise_also_elsewhere_and_after_a_failed_step():
    model = near_contact()
    model.run(0.6, every=0.1)
    saved = model.save()
    first = go(model, 40)
    assert np.max(np.abs(model.wrenches()[0])) > 0.1  # in contact by then
    model.restore(saved)
    assert same(go(model, 40), first)
    other = near_contact()
    other.restore(saved)
    assert same(go(other, 40), first)
    other.restore(saved)
    go(other, 30)
    saved, first = other.save(), go(other, 10)
    other.restore(saved)
    pose = other.target_pose()
    nearest = pose.position + pose.rotation @ [0, 0.006, 0.003]  # into the cable that comes, at 7 m/s
    other.move_target(Pose(nearest, pose.rotation, STILL, STILL))
    with pytest.raises(
        SnareStepError,
        match=r"step of 0.001 s at 0.63 s failed, the (pin went .* into a cable|solver did not converge); take",
    ):
        other.step(1e-3)
    assert same(other.save(), saved)
    assert same(go(other, 10), first)


def test_macro_steps_agree_with_one_run():
    """The partition changes when the Jacobian is renewed: results differ by the Newton tolerance, not by the step."""
    whole = near_contact().run(0.7, every=0.1)
    steps = near_contact().run(0.7, every=0.01)
    assert np.max(np.abs(whole.cables[-1] - steps.cables[-1])) < 1e-6
    assert whole.first_contact == pytest.approx(steps.first_contact, abs=2.1e-3)  # one step


def test_moving_both_bodies_alike_changes_nothing():
    """A steady drift of end effector and target together: the same forces as at rest (Galileo)."""
    still = near_contact()
    drift = np.array([0.03, -0.02, 0.05])
    rotation = still.effector_pose().rotation
    at_rest = still.run(0.7, every=0.05)
    effector = Pose(np.zeros(3), rotation, drift, STILL)
    quaternion = np.roll(Rotation.from_matrix(rotation).as_quat(), 1)
    target = Target(
        "moved", position=rotation @ [0.2369, 0.0747, 0.0402], orientation=quaternion, velocity=drift.tolist()
    )
    # the cables start at rest, behind the drift: their swing shifts the contact a little
    moving = SnareModel(QUICK, target, effector=effector).run(0.7, every=0.05)
    assert moving.first_contact == pytest.approx(at_rest.first_contact, abs=0.02)
    assert np.allclose(moving.target_position[-1], rotation @ [0.2369, 0.0747, 0.0402] + 0.7 * drift, atol=1e-12)


def test_a_capture_is_the_same_anywhere_and_in_any_orientation():
    position, body = np.array([0.2369, 0.0747, 0.0402]), {"mass": 5.0, "inertia": np.diag([0.05, 0.2, 0.2])}
    here = SnareModel(QUICK, Target("free", position, (1.0, 0.0, 0.0, 0.0), **body)).run(1.0, every=0.1)
    turn, place = Rotation.from_rotvec([0.7, -1.9, 0.4]), np.array([120.0, -40.0, 7.0])
    moved = Target("free", place + turn.apply(position), np.roll(turn.as_quat(), 1), **body)
    there = SnareModel(QUICK, moved, effector=Pose(place, turn.as_matrix(), STILL, STILL)).run(1.0, every=0.1)
    assert here.first_contact == pytest.approx(there.first_contact, abs=1e-9)  # the same step
    # Newton's tolerance, not the frame, makes a difference after contact
    assert np.max(np.abs(turn.apply(there.target_position - place, inverse=True) - here.target_position)) < 1e-7
    assert np.max(np.abs(turn.inv().as_matrix() @ (there.cables - place)[..., None] - here.cables[..., None])) < 1e-6
    rate = turn.apply(there.target_angular_velocity, inverse=True)
    assert np.max(np.abs(rate - here.target_angular_velocity)) < 1e-5
    assert np.max(np.abs(here.target_angular_velocity)) > 1e-2


def test_end_springs_hold_the_bow_and_store_energy():
    model = SnareModel(QUICK.with_values(end_stiffness=0.5), Target("free", mass=5.0))
    history = model.run(0.5, every=0.05)
    assert np.max(np.abs(history.energy_residual)) < 5e-3 * np.max(np.abs(history.energies["ring_work"]))
    free = SnareModel(QUICK, Target("free", mass=5.0)).run(0.5, every=0.05)
    assert history.energies["strain"][-1] > free.energies["strain"][-1]


@pytest.mark.parametrize("support", ["spring", "pendulum"])
def test_a_hanging_target_rests(support):
    model = SnareModel(SnareParameters(), Target(support, inertia=np.eye(3), hang_point=(0.1, 0, 0)))
    history = model.run(0.2, every=0.05)
    moved = history.target_position - history.target_position[0]
    assert np.max(np.abs(moved)) < 1e-4  # its weight is carried; hung askew by 4°, it starts to turn about its centre
    assert np.max(np.abs(history.energies["target"] - history.energies["target"][0])) < 1e-6


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SnareModel(QUICK, Target("moved", position=(0.2369, 0.126, 0.0))), "mm inside a cable"),
        (lambda: SnareModel(QUICK, Target("free"), "rough"), "accuracy is 'rough'; give one of default, fine"),
        (lambda: SnareModel(QUICK, Target("free"), time=-1.0), "time is -1 s"),
        (lambda: SnareModel(QUICK, Target("free"), time=2.0), "at the start, 2 s, the ring has turned by .* rad"),
        (lambda: Target("spring", damping=-1.0), "damping is -1.0; give a number >= 0"),
        (lambda: Target("free", mass=-1), "mass is -1; give a number > 0"),
        (lambda: Target("free", inertia=np.diag([1, 1, 3])), "none above the sum"),
        (lambda: Target("free", orientation=(1, 1, 0, 0)), "give a unit quaternion"),
        (lambda: Target("afloat"), "support is 'afloat'; give one of spring, pendulum, free, moved"),
        (lambda: SnareModel(QUICK, Target("free")).step(0.0), "step is 0 s; give a number > 0"),
    ],
)
def test_bad_input_is_one_clear_line(make, message):
    with pytest.raises(InputError, match=message) as error:
        make()
    assert "\n" not in str(error.value)


def test_fine_setting_is_near_the_default():
    target = Target("pendulum", mass=10.0)
    default = SnareModel(QUICK, target).run(0.8, every=0.05)
    fine = SnareModel(QUICK, target, Accuracy(1e-3, 16, 2e-4)).run(0.8, every=0.05)
    assert np.max(np.abs(default.target_position - fine.target_position)) < 5e-5


@pytest.mark.parametrize(("stiffness", "share"), [(7.8e7, 1.0), (8.1e7, 0.5)])
def test_a_soft_pin_may_give_way_by_the_whole_radius_of_the_cable_and_a_hard_one_by_half(stiffness, share):
    """Half the radius of 2 mm, and 2.5 kN, a hundredth of EA: 7.95e7 N/m^1.5."""
    model = SnareModel(SnareParameters(hertz_stiffness=stiffness), Target("spring"))
    assert model._deepest() == pytest.approx(share * 0.002)
