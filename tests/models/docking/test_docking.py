"""The rigid half of an end effector against statics and one-dimensional dynamics."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from snarelab.errors import InputError
from snarelab.models.docking.body import DockingBody
from snarelab.models.docking.closed_forms import (
    bounce,
    closing_twist,
    contact_wrenches,
    damping_of,
    drive,
    flank_ratio,
    jamming_friction,
    seated_share,
    seated_stiffness,
)
from snarelab.models.docking.contact import damping_number
from snarelab.models.docking.groove import AZIMUTHS, flank
from snarelab.models.docking.parameters import PRELOAD, DockingParameters

P = DockingParameters()
SMOOTH = P.with_values(friction=0.0)
MASS, INERTIA = 90.0, (25.0, 60.0, 60.0)
SEAT = np.array([-P.seat, 0.0, 0.0])


@pytest.fixture(scope="module")
def body():
    return DockingBody(MASS, INERTIA)


def about_balls(force, moment=(0.0, 0.0, 0.0)):
    """A wrench at the balls' middle as one about the body's origin."""
    return np.concatenate([force, np.cross([P.seat, 0, 0], force) + moment])


def settled(body, parameters, wrench, state=None, duration=3.0):
    return body.run(parameters, duration, SEAT, wrench=wrench, longest=2e-3, state=state)


def test_a_seated_preload_is_shared_evenly(body):
    run = settled(body, SMOOTH, about_balls([PRELOAD, 0, 0]))
    assert seated_share(PRELOAD, P.flank) == pytest.approx(1296, abs=0.5)  # by hand
    np.testing.assert_allclose(run.normal[-1], seated_share(PRELOAD, P.flank), rtol=5e-3)


def middle(run, row):
    turn = Rotation.from_quat(run.quaternion[row], scalar_first=True)
    return run.place[row] + turn.apply([P.seat, 0, 0]), turn.as_rotvec()


@pytest.mark.parametrize(
    ("which", "force", "moment"),
    [(0, [50.0, 0, 0], [0, 0, 0]), (1, [0, 50.0, 0], [0, 0, 0]), (2, [0] * 3, [5.0, 0, 0]), (3, [0] * 3, [0, 5.0, 0])],
)
def test_the_seat_is_as_stiff_as_six_flanks_are(body, which, force, moment):
    """Without friction; the preload is small, so that its own lever counts for nothing."""
    settled(body, SMOOTH, about_balls([300.0, 0, 0]))
    before = body.last
    still = settled(body, SMOOTH, about_balls([300.0, 0, 0]), before, 6.0)
    moved = settled(body, SMOOTH, about_balls([300.0 + force[0], *force[1:]], moment), before, 6.0)
    (place, turn), (there, turned) = middle(still, -1), middle(moved, -1)
    given = np.concatenate([force, moment])
    gone = np.concatenate([there - place, turned - turn])
    k = int(np.argmax(np.abs(given)))
    assert given[k] / gone[k] == pytest.approx(seated_stiffness(P)[which], rel=5e-3)


def test_what_statics_says_about_one_flank_and_five_contacts():
    """Ratios by hand; the limits of jamming are those of the design page, computed there on another way."""
    assert flank_ratio(np.pi / 4, 0.0) == pytest.approx(1.0)
    assert flank_ratio(np.pi / 4, 1.0) == pytest.approx(0.0, abs=1e-12)  # blocks from gamma = 90 deg - phi on
    assert [jamming_friction(np.deg2rad(a)) for a in (30, 45, 60)] == pytest.approx([0.364, 0.318, 0.230], abs=1e-3)
    normals, _ = contact_wrenches(P)
    for missing in range(6):
        twist = closing_twist(P, missing)
        assert np.abs(np.delete(normals, missing, axis=0) @ twist).max() < 1e-12
        assert normals[missing] @ twist < 0
        assert drive(P, 0.3, missing) > 0 > drive(P, 0.34, missing)


@pytest.mark.parametrize(("friction", "seats"), [(0.15, True), (0.30, True), (0.34, False), (0.45, False)])
def test_it_seats_below_the_limit_of_jamming_and_jams_above(body, friction, seats):
    """Five contacts touch, the sixth is open by millimetres; 20 N push along the axis."""
    off = -5e-3 * closing_twist(P, 5) / np.abs(closing_twist(P, 5)).max()
    turn = Rotation.from_rotvec(off[3:])
    run = body.run(
        P.with_values(friction=friction), 4.0, off[:3] - turn.apply([P.seat, 0, 0]), turn.as_quat(scalar_first=True),
        wrench=[20.0, 0, 0, 0, 0, 0], longest=2e-3,
    )  # fmt: skip
    assert np.abs(run.off[0]).max() > 1e-3
    left = np.abs(run.off[-1]).max()
    assert left < 2e-5 if seats else left > 2e-4
    assert np.linalg.norm(run.velocity[-1]) < 1e-3


@pytest.mark.parametrize(("friction", "slides"), [(0.56, True), (0.60, False)])
def test_one_flank_blocks_from_where_friction_bears_the_whole_push(body, friction, slides):
    """Rolled, every ball stands on one flank at 60 degrees to the axis: nothing slides from tan 30 deg = 0.577 on.

    Damped well, as a contact that rattles lets go of its friction at every bounce.
    """
    own = P.with_values(friction=friction, flank=np.deg2rad(60), restitution=0.05, restitution_speed=1e-4)
    aside, turn = 5e-3, Rotation.from_rotvec([5e-3 / P.radius, 0, 0])
    place = [-P.seat - aside / np.tan(own.flank), 0, 0]
    run = body.run(own, 4.0, place, turn.as_quat(scalar_first=True), wrench=[20.0, 0, 0, 0, 0, 0], longest=2e-3)
    assert (flank_ratio(own.flank, friction) > 0) == slides
    if slides:
        assert np.abs(run.off[-1]).max() < 0.4 * aside
        return
    assert np.abs(run.off[-1]).max() > 0.9 * aside
    assert np.abs(run.velocity[-1]).max() < 1e-5
    # A third of the push each, as a normal force and the friction that makes it axial.
    np.testing.assert_allclose(run.normal[-1].max(), 20 / 3 * np.sin(own.flank), rtol=5e-3)


@pytest.mark.parametrize(("friction", "stays"), [(0.34, False), (0.38, True)])
def test_a_steep_wedge_locks_itself(body, friction, stays):
    """At 20 degrees to the axis flanks hold a ball by themselves from tan 20 deg = 0.364 on: 20 N pull at it.

    The presliding is short against what the preload compresses, which else lets go before friction turns round.
    """
    own, state, run = P.with_values(friction=friction, flank=np.deg2rad(20), breakaway=2e-6), None, None
    for push in (3000.0, 1000.0, 300.0, 100.0, 0.0, -20.0):
        run = settled(body, own, about_balls([push, 0, 0]), state, 1.0)
        state = body.last
    assert run is not None
    assert (own.flank < np.arctan(friction)) == stays
    gone = np.abs(run.off[-1]).max()
    assert gone < 5e-4 if stays else gone > 0.05


@pytest.mark.parametrize("speed", [0.005, 0.01, 0.03])
def test_a_bounce_is_hunts_and_crossleys(body, speed):
    """All six flanks at once: k and D of the axial motion are 6 k sin² and D sin of one flank's."""
    s = np.sin(P.flank)
    run = body.run(SMOOTH, 0.2, SEAT - np.array([1e-5, 0, 0]), velocity=[speed, 0, 0], longest=2e-5)
    restitution, peak = bounce(MASS, 6 * P.stiffness * s * s, damping_of(P) * s, speed)
    assert -run.velocity[-1, 0] / speed == pytest.approx(restitution, rel=1e-2)
    assert np.abs(run.force[:, 0]).max() == pytest.approx(peak, rel=1e-2)


@pytest.mark.parametrize("restitution", [0.05, 0.3, 0.9])
def test_the_damping_gives_the_restitution_that_was_asked_for(restitution):
    d = damping_number(restitution) / 0.02
    assert bounce(50.0, 1e7, d, 0.02)[0] == pytest.approx(restitution, rel=1e-6)


def test_a_soft_bounce_is_the_springs():
    """With next to no damping the peak is v √(k m)."""
    restitution, peak = bounce(250.0, 1e7, 1e-3, 0.01)
    assert restitution == pytest.approx(1.0, abs=1e-4)
    assert peak == pytest.approx(0.01 * np.sqrt(250.0 * 1e7), rel=1e-4)


def test_energy_is_accounted_for(body):
    turn = Rotation.from_rotvec([0.01, 0.02, -0.015])
    run = body.run(
        P, 2.0, SEAT + np.array([-0.015, 0.004, -0.003]), turn.as_quat(scalar_first=True), velocity=[0.01, 0, 0],
        wrench=[100.0, 3.0, -2.0, 0.5, 0.2, 0.1],
    )  # fmt: skip
    residual = run.energy - run.energy[0] - run.given + run.lost
    assert run.lost[-1] > 1.0
    assert np.abs(residual).max() < 1e-4 * np.abs(run.given).max()
    assert np.abs(run.off[-1]).max() < 1e-3


def test_a_seated_body_does_not_creep(body):
    """Bristles hold what a regularised law would let go: half of what slips pulls sideways for 20 s."""
    settled(body, P, about_balls([PRELOAD, 0, 0]))
    settled(body, P, about_balls([PRELOAD, 300.0, 0]), body.last, 2.0)
    run = settled(body, P, about_balls([PRELOAD, 300.0, 0]), body.last, 20.0)
    assert np.abs(run.place[-1] - run.place[0]).max() < 1e-8


def test_steps_are_of_fifth_order():
    """Of a smooth stretch: six flanks in touch and no friction; the step is all that limits the error."""
    light = SMOOTH.with_values(restitution=0.95)  # a damping of the usual size makes steps short before they are exact
    free = DockingBody(MASS, INERTIA, tolerance=1e9)
    run = free.run(SMOOTH, 3.0, SEAT, wrench=about_balls([3000.0, 0, 0]), longest=1e-4)
    start = free.last.copy()
    assert (run.normal[-1] > 0).all()

    def end(step):
        free.run(light, 0.016, SEAT, wrench=about_balls([3500.0, 20.0, 0]), longest=step, state=start)
        return free.last[:3]

    exact = end(1e-5)
    errors = [np.abs(end(step) - exact).max() for step in (4e-4, 2e-4)]
    assert 4.2 < np.log2(errors[0] / errors[1]) < 6.0


def test_the_gap_is_the_distance_to_a_rounded_wedge():
    """Against the least distance to flank, land and arc, each searched along its length."""
    import casadi as ca

    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    gap = ca.Function("gap", [x, y], list(flank(x, y, ca.SX(P.flank), ca.SX(P.half_width), ca.SX(P.edge))))
    s, c, w, r = np.sin(P.flank), np.cos(P.flank), P.half_width, P.edge
    corner = np.array([r - w * c / s, (r - s * (r - w * c / s)) / c])  # of the lines set back by the rounding

    def nearest(point):
        def along(way):
            return minimize_scalar(
                lambda t: np.hypot(*(corner + t * np.array(way) - point)), bounds=(0, 0.2), method="bounded",
                options={"xatol": 1e-12},
            ).fun  # pyright: ignore[reportAttributeAccessIssue]  # fmt: skip

        return min(along((c, -s)), along((0.0, 1.0))) - r

    rng = np.random.default_rng(3)
    for point in rng.uniform([-0.05, -0.03], [-0.002, 0.06], (200, 2)):
        found, nx, ny = (float(v) for v in gap(*point))
        if s * point[0] + c * point[1] < 0 or point[0] < -w * c / s:  # outside the wedge
            assert found == pytest.approx(nearest(point), abs=1e-8)
        step = 1e-7
        slope = [(float(gap(*(point + d))[0]) - found) / step for d in (np.array([step, 0]), np.array([0, step]))]
        np.testing.assert_allclose(slope, [nx, ny], atol=1e-4)
        assert np.hypot(nx, ny) == pytest.approx(1.0)


def test_numbers_out_of_range_are_refused():
    with pytest.raises(InputError, match=r"docking: flank is 1\.6 rad; give more than 0 and < pi/2"):
        DockingParameters(flank=1.6)
    with pytest.raises(InputError, match="no parameter 'frction'; nearest is 'friction'"):
        P.with_values(frction=0.1)
    assert len(AZIMUTHS) == 3
    assert all(d.source and d.unit for d in P.dimensions())
