"""What the snare's effects do in the engine, against closed forms and conservation laws."""

import numpy as np
import pytest

from snarelab.errors import InputError
from snarelab.models.snare.drive import ring_motion
from snarelab.models.snare.line import DAMPING, LINE_SIZE, STIFFNESS, line_pull, line_slope
from snarelab.models.snare.model import SnareModel
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.ring_drive import RingDrive
from snarelab.models.snare.settled import settled
from snarelab.models.snare.target import Target

P = SnareParameters()
FAR = (0.6, 0.3, 0.0)
"""Out of the cables' reach [m]."""
GRAVITY, LENGTH, CLEARANCE = 9.81, 2.0, 5e-3
STILL = (0.0, 0.0, 0.0)


def held_open(_time):
    return 0.0, 0.0


def hung_line(clearance, stiffness=2000.0, weight=245.0):
    """A line that hangs along −x from the origin, its top free within the clearance."""
    line = np.zeros(LINE_SIZE)
    line[:3] = stiffness, LENGTH - weight / stiffness, clearance
    line[3:6] = -1.0, 0.0, 0.0
    return line


def test_inside_its_clearance_a_line_pulls_nowhere_sideways():
    line = hung_line(CLEARANCE)
    for aside in (0.0, 0.2, 0.5, 0.7):
        force, _, _ = line_pull(line, (-LENGTH, aside * CLEARANCE, 0.0), STILL)
        assert force[0] == pytest.approx(245.0, rel=1e-5)
        # The corner is rounded over a tenth of the clearance; a pendulum would pull by 245 N/2 m times the distance.
        assert abs(force[1]) <= 0.02 * 245.0 / LENGTH * CLEARANCE


def test_beyond_it_the_line_swings_about_the_rim():
    line = hung_line(CLEARANCE)
    for aside in (3.0, 10.0):
        y = aside * CLEARANCE
        force, _, _ = line_pull(line, (-LENGTH, 0.6 * y, 0.8 * y), STILL)
        past = y - CLEARANCE
        reach = np.hypot(LENGTH, past)
        tension = 2000.0 * (reach - (LENGTH - 245.0 / 2000.0))
        # What the rounding moves the rim by at a distance d is c w^2/(4 d^2), here below 1 % of what is past it.
        assert force[1] == pytest.approx(-0.6 * tension * past / reach, rel=1e-2)
        assert force[2] == pytest.approx(-0.8 * tension * past / reach, rel=1e-2)


def test_the_line_stores_what_it_takes():
    line, rng = hung_line(CLEARANCE), np.random.default_rng(0)
    slopes = np.empty((3, 3))
    for point in rng.normal(size=(20, 3)) * [0.01, 0.008, 0.008] - [LENGTH, 0, 0]:
        steps = 1e-6 * np.eye(3)
        energies = [np.diff([line_pull(line, tuple(point + x), STILL)[1] for x in (-s, s)])[0] for s in steps]
        np.testing.assert_allclose(line_pull(line, tuple(point), STILL)[0], -np.array(energies) / 2e-6, atol=1e-4)
        line_slope(line, tuple(point), STILL, slopes)
        np.testing.assert_allclose(slopes, slopes.T, atol=1e-2)  # a force with an energy: to the differences' rounding


def test_a_line_damps_by_the_rate_of_its_own_length_only():
    """f(v) − f(0) is along −∂l/∂u, and takes c l̇² of power, l̇ by differences along the path."""
    line, rng = hung_line(CLEARANCE), np.random.default_rng(3)
    line[DAMPING] = 40.0
    for point in rng.normal(size=(20, 3)) * [0.01, 0.008, 0.008] - [LENGTH, 0, 0]:
        velocity = rng.normal(size=3)
        ahead, behind = (line_pull(line, tuple(point + t * velocity), STILL)[1] for t in (1e-6, -1e-6))
        rate = (np.sqrt(2 * ahead / line[STIFFNESS]) - np.sqrt(2 * behind / line[STIFFNESS])) / 2e-6
        moving, still = (np.array(line_pull(line, tuple(point), tuple(v))[0]) for v in (velocity, 0 * velocity))
        assert (moving - still) @ velocity == pytest.approx(-40.0 * rate**2, rel=1e-5)
        np.testing.assert_allclose(np.cross(moving - still, still), 0.0, atol=1e-9 * float(still @ still))


@pytest.mark.parametrize("clearance", [0.0, CLEARANCE])
def test_a_suspended_target_bounces_down_by_its_damping_with_and_without_play(clearance):
    """x = v/ω_d exp(−δt) sin(ω_d t), δ = c/(2m): the line carries all of it, play is sideways."""
    speed, stiffness, damping = -0.02, 800.0, 40.0
    target = Target(
        "spring", position=FAR, velocity=(speed, 0, 0), stiffness=stiffness, damping=damping, clearance=clearance
    )
    history = SnareModel(P, target, drive=held_open).run(2.0, every=0.05)
    decay = damping / (2 * target.mass)
    rate = np.sqrt(stiffness / target.mass - decay**2)
    expected = speed / rate * np.exp(-decay * history.times) * np.sin(rate * history.times)
    np.testing.assert_allclose(history.target_position[:, 0] - FAR[0], expected, atol=1e-3 * abs(speed) / rate)


@pytest.mark.parametrize("support", ["spring", "pendulum"])
def test_a_target_coasts_through_the_play_and_keeps_its_energy(support):
    speed = 4e-3
    target = Target(support, position=FAR, velocity=(0.0, speed, 0.0), clearance=CLEARANCE)
    history = SnareModel(P, target, drive=held_open).run(2.0, every=0.05)
    y = history.target_position[:, 1] - FAR[1]
    coasting = history.times * speed < 0.6 * CLEARANCE
    # The rounded corner slows it by less than the pendulum's own pull there, a fiftieth of it: see above.
    np.testing.assert_allclose(y[coasting], speed * history.times[coasting], atol=2e-5)
    energy = history.energies["target"]
    assert np.ptp(energy) < 2e-2 * 0.5 * target.mass * speed**2


def test_the_umbilical_is_a_linear_spring():
    target = Target("free", position=FAR, velocity=(0.02, 0.0, -0.01), umbilical=100.0)
    rate = np.sqrt(100.0 / target.mass)
    history = SnareModel(P, target, drive=held_open).run(3.0, every=0.1)
    moved = history.target_position - FAR
    expected = np.sin(rate * history.times)[:, None] / rate * np.array(target.velocity)
    # Generalised-alpha at 2 ms shifts a phase of 6 rad by (rate dt)^2/12 of it, and damps less.
    np.testing.assert_allclose(moved, expected, atol=1e-4 * 0.02 / rate)


def test_a_pretensioned_cable_is_shorter_by_its_strain_and_at_rest():
    tight = P.with_values(cable_pretension=500.0)

    def arc(parameters):
        nodes = settled(parameters, 20)
        size = parameters.cable_length / 20
        u = np.linspace(0, 1, 21)[:, None]
        slope = (6 * u**2 - 6 * u, (1 - 4 * u + 3 * u**2) * size, 6 * u - 6 * u**2, (3 * u**2 - 2 * u) * size)
        pieces = [sum(w * x for w, x in zip(slope, (*nodes[0, k], *nodes[0, k + 1]), strict=True)) for k in range(20)]
        return sum(np.trapezoid(np.linalg.norm(piece, axis=1), u[:, 0]) for piece in pieces)

    shorter = P.cable_length * 500.0 / P.axial_stiffness
    assert arc(P) - arc(tight) == pytest.approx(shorter, rel=1e-3)  # its bow presses the cable by some 1e-5 of that
    rest = SnareModel(tight, Target("spring", position=FAR), drive=held_open).run(0.2)
    # A cable whose engine did not know of the strain would spring by EA e^2/2, 0.14 J.
    assert rest.energies["kinetic"].max() < 1e-9


def test_a_recorded_ramp_drives_the_ring_as_the_ramp_itself():
    times = np.arange(0, 3.0, 0.01)
    angle = np.array([ring_motion(t, P.ring_rate, P.ring_travel, P.ring_ramp)[0] for t in times])
    noisy = angle + 2e-4 * np.random.default_rng(1).normal(size=len(times))
    drive = RingDrive.of_samples(times, noisy)
    followed = np.array([drive(t) for t in times])
    assert np.abs(followed[:, 0] - angle).max() < 1e-3  # rad: 0.13 mm at the ring
    assert np.sqrt(np.mean((followed[30:-1, 1] - P.ring_rate) ** 2)) < 0.04 * P.ring_rate  # noise over 0.1 s
    turned_about = RingDrive.of_samples(times, -noisy)
    np.testing.assert_array_equal(turned_about.table, drive.table)
    assert drive(-1.0) == (0.0, 0.0)
    assert drive(9.0) == (drive.table[-1, 0], 0.0)


def test_a_drive_that_is_the_ramp_changes_nothing():
    target = Target("spring")
    ramp = SnareModel(P, target).run(0.3)
    driven = SnareModel(P, target, drive=lambda t: ring_motion(t, P.ring_rate, P.ring_travel, P.ring_ramp)).run(0.3)
    np.testing.assert_array_equal(ramp.cables, driven.cables)


def test_a_ring_that_starts_closed_is_refused():
    with pytest.raises(InputError, match="ring open"):
        RingDrive.of_samples(np.arange(50) * 0.01, np.full(50, 0.3))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"umbilical": -1.0}, "umbilical is -1.0"),
        ({"clearance": float("nan")}, "clearance is nan"),
        ({"support": "free", "clearance": 0.01}, "no line holds it"),
    ],
)
def test_what_cannot_hold_a_target_is_refused(values, words):
    with pytest.raises(InputError, match=words):
        Target(**{"support": "spring", **values})
