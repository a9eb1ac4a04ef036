"""A recording of a capture brought to its track: means, tares, starts and notes, from recordings of closed forms."""

# pyright: reportArgumentType=false

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from captures_by_hand import capture, track
from scipy.spatial.transform import Rotation

from snarelab.errors import InputError
from snarelab.identification.snare.recording import (
    _about,
    _capture,
    _mean_turn,
    _means,
    _scatter,
    _start,
    _turned,
    _turns,
    body_of,
    check_sensors,
    sensed_by,
)
from snarelab.models.model import Model
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.setup import CaptureSetup, read_setup
from snarelab.models.snare.target import Target

FILE = Path("model.toml")
TREE = read_setup(FILE, "model", {"target": "free"}, [0.0, 0.0, 0.0])
MODEL = Model(FILE, "model", "snare_capture", None, TREE, "fixed", (), {}, None, {})
"""A floating target without inertia: it keeps its orientation."""


def recorded(time, notes=(), **columns):
    """A recording; ``place`` (n, 3) of the target, ``turn`` (n, 4), and ``<sensor>`` (n, 3) for other names."""
    stems = {"place": ("pos.target", "xyz"), "turn": ("quat.target", "wxyz"), "ring": ("angle", ("ring",))}
    data = {}
    for name, values in columns.items():
        stem, axes = stems.get(name, (f"force.{name}", "xyz"))
        data |= {f"{stem}.{axis}": ("time", np.reshape(values, (len(time), -1))[:, i]) for i, axis in enumerate(axes)}
    return xr.Dataset(data, coords={"time": time}, attrs={"notes": notes})


# Means


@pytest.mark.parametrize(
    ("since", "row"),
    [(0.0, 0), (0.001, 1), (0.05, 1), (0.0500001, 2), (0.1, 2), (0.15, 3), (-0.2, 0), (0.16, None), (9.0, None)],
)
def test_a_sample_belongs_to_the_50_ms_that_end_at_the_next_time(since, row):
    """Times 0 to 0.15 s. A sample at a time itself is the last one of its mean; what comes after all is nowhere."""
    found = _means(np.array([since]), np.array([[7.0]]), 0.05 * np.arange(4))[:, 0]
    expected = np.full(4, np.nan)
    if row is not None:
        expected[row] = 7.0
    np.testing.assert_array_equal(found, expected)


def test_means_leave_gaps_out_column_by_column():
    """Three samples in one window: 1, 2, 6 and 10, gap, 30."""
    values = np.array([[1.0, 10.0], [2.0, np.nan], [6.0, 30.0], [np.nan, 4.0]])
    found = _means(np.array([0.01, 0.02, 0.05, 0.06]), values, 0.05 * np.arange(3))
    np.testing.assert_allclose(found, [[np.nan, np.nan], [3.0, 20.0], [np.nan, 4.0]])


def test_a_mean_about_a_time_takes_25_ms_on_either_side():
    """A line's mean about a time is its value there, but for the half sample by which one end is open."""
    since = 0.005 * np.arange(41)
    found = _about(since, since[:, None], 0.05 * np.arange(4))[:, 0]
    # Ten samples each, (t - 0.025, t + 0.025]: their mean is 2.5 ms late. At first only 0 to 25 ms.
    np.testing.assert_allclose(found, [0.0125, 0.0525, 0.1025, 0.1525], rtol=1e-9)


def test_scatter_is_the_root_mean_square_of_what_is_known():
    assert _scatter(np.array([3.0, np.nan, 4.0])) == pytest.approx(np.sqrt(12.5))
    assert _scatter(np.full(3, np.nan)) == 0.0
    assert _scatter(np.zeros(0)) == 0.0


def about_z(angles):
    return Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])).as_quat(scalar_first=True)


def test_orientations_are_averaged_whatever_their_signs():
    """0.1 and 0.3 rad about z in turn, half of them with the other sign: 0.2 rad, of unit length."""
    turns = about_z(np.tile([0.1, 0.3], 10)) * np.where(np.arange(20) % 3 == 0, -1.0, 1.0)[:, None]
    turns[7] = np.nan
    found = _turns(0.05 * np.repeat(np.arange(2), 10), turns, 0.05 * np.arange(2))
    # Without row 7 (0.3 rad) the first has five of 0.1 and four of 0.3.
    sines = np.array([5 * np.sin(0.05) + 4 * np.sin(0.15), np.sin(0.05) + np.sin(0.15)])
    cosines = np.array([5 * np.cos(0.05) + 4 * np.cos(0.15), np.cos(0.05) + np.cos(0.15)])
    np.testing.assert_allclose(2 * np.arctan(found[:, 3] / found[:, 0]), 2 * np.arctan(sines / cosines), rtol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=1e-12)


@pytest.mark.parametrize("angle", [-3.0, -2.0, -1.0, -0.1, 0.1, 1.0, 2.0, 3.0])
def test_the_mean_orientation_has_a_positive_first_number(angle):
    turns = -about_z([angle - 0.1, angle + 0.1])
    np.testing.assert_allclose(_mean_turn(np.vstack([turns, np.full(4, np.nan)])), about_z([angle])[0], atol=1e-12)


@pytest.mark.parametrize(("number", "largest"), [(1, 0.05), (3, 0.6)])
def test_the_largest_turn_leaves_single_samples_out(number, largest):
    """Of 101 samples two may be off: the turn from the start is 0.05 rad but for some of 0.6."""
    turns = about_z(np.where(np.arange(101) < number, 0.7, 0.15))
    assert _turned(turns, about_z([0.1])[0].tolist()) == pytest.approx(largest, rel=1e-6)


# Where it starts


@pytest.mark.parametrize("bend", [0.0, 2.0])
def test_a_start_is_the_lines_or_where_motion_is_bent_the_cubics(bend):
    """p + v t + bend t² + t³ without noise: both are met at t = 0. A line fits only where nothing is bent."""
    t = np.linspace(0.0, 0.5, 26)
    place = np.outer(np.ones(26), [0.1, 0.2, 0.3]) + np.outer(t + bend * (t**2 + t**3), [0.2, -0.1, 0.0])
    position, velocity, *_ = _start(t, place)
    np.testing.assert_allclose(position, [0.1, 0.2, 0.3], atol=1e-9)
    np.testing.assert_allclose(velocity, [0.2, -0.1, 0.0], atol=1e-9)


def zigzag(count):
    """Noise whose straight line is known: +1, -1, -1, +1 in turn has neither mean nor slope."""
    return np.tile([1.0, -1.0, -1.0, 1.0], count // 4)


@pytest.mark.parametrize(("moves", "expected"), [(5.5, True), (4.5, False)])
def test_a_velocity_counts_from_five_standard_deviations_of_it(moves, expected):
    """Zigzag of 1 mm on x: the slope scatters by sqrt(sum r²/(n - 2)/sum (t - mean)²), to which comes 1 µm/s."""
    t = 0.01 * np.arange(40)
    noise = 1e-3 * zigzag(40)
    scatter = np.sqrt(np.sum(noise**2) / 38 / np.sum((t - t.mean()) ** 2)) + 1e-6
    speed = moves * scatter
    position, velocity, *_ = _start(t, np.column_stack([noise, 0.5 + speed * t, 0.0 * t]))
    if expected:
        np.testing.assert_allclose(velocity, [0.0, speed, 0.0], atol=1e-12)
        np.testing.assert_allclose(position, [0.0, 0.5, 0.0], atol=1e-12)
    else:
        np.testing.assert_array_equal(velocity, 0.0)
        np.testing.assert_allclose(position, [0.0, 0.5 + speed * t.mean(), 0.0], atol=1e-12)


def test_a_start_is_known_as_well_as_the_line_through_it():
    """Slope of a line: s / sqrt(sum (t - mean)²) on each axis. A line with another slope turns about its middle."""
    t = 0.01 * np.arange(40)
    place = np.column_stack([0.2 * t + 1e-3 * zigzag(40), -0.1 * t + 2e-3 * zigzag(40), np.zeros(40)])
    start = _start(t, place)
    noise = np.array([1e-3, 2e-3, 0.0]) * np.sqrt(40 / 38)
    np.testing.assert_allclose(start.spread, noise / np.sqrt(np.sum((t - t.mean()) ** 2)), atol=1e-12)
    setup = CaptureSetup(SnareParameters(), Target("free"))
    moved = start.shifted(setup, (1.0, -2.0, 3.0)).target
    faster = moved.velocity - start.velocity
    np.testing.assert_allclose(faster, start.spread * [1.0, -2.0, 3.0], atol=1e-15)
    np.testing.assert_allclose(moved.position + faster * t.mean(), start.position, atol=1e-15)


@pytest.mark.parametrize(("known", "found"), [(7, False), (8, True)])
def test_a_start_takes_eight_samples(known, found):
    t = 0.01 * np.arange(20)
    place = np.full((20, 3), np.nan)
    place[:known] = [0.1, 0.2, 0.3]
    position, velocity, *_ = _start(t, place)
    np.testing.assert_allclose(position, [0.1, 0.2, 0.3] if found else np.full(3, np.nan))
    np.testing.assert_array_equal(velocity, 0.0)


# A whole recording

TIME = 30.0 + 0.01 * np.arange(251)
"""[s] Two and a half seconds on a clock that shows 30 s at first."""
DRIFT = np.outer(TIME - TIME[0], [0.2, 0.0, -0.1]) + np.array([0.5, 0.1, 0.0])


def test_a_recording_becomes_times_from_its_start_and_a_target_that_starts_as_it_moves():
    found = _capture(MODEL, "a.csv", recorded(TIME, ("one note",), place=DRIFT))
    assert (found.path, found.body, found.zero) == ("a.csv", "target", 30.0)
    np.testing.assert_allclose(found.times, 0.05 * np.arange(51), rtol=1e-12)
    np.testing.assert_allclose(found.setup.target.position, [0.5, 0.1, 0.0], atol=1e-9)
    np.testing.assert_allclose(found.setup.target.velocity, [0.2, 0.0, -0.1], atol=1e-9)
    # Five samples from 20 ms before to 20 ms after; at first only those after, at last those before and itself.
    np.testing.assert_allclose(found.measured.position[1:-1], DRIFT[5:-5:5], atol=1e-9)
    np.testing.assert_allclose(found.measured.position[0], DRIFT[:3].mean(0), atol=1e-9)
    assert found.drive is None
    assert found.notes[0] == "one note"
    assert "quat.target is not recorded; its orientation is the model's" in found.notes
    assert any(note.startswith("angle.ring is not recorded") for note in found.notes)
    assert (dict(found.sensors), dict(found.measured.force)) == ({}, {})


def test_noise_of_position_is_that_of_neighbours_differences():
    """In each 50 ms about a time x stands at ±1 mm, the next one on the other side: differences of 2 mm in every row of
    three numbers, over three and two, for the first half second alone."""
    number = np.clip(np.ceil((TIME - TIME[0] - 0.025) / 0.05 - 1e-9), 0, None)
    place = np.zeros((251, 3))
    place[:, 0] = np.where(number < 10, 1e-3 * (-1.0) ** number, 0.5)
    found = _capture(MODEL, "a.csv", recorded(TIME, place=place))
    assert found.noise["position"] == pytest.approx(2e-3 / np.sqrt(3) / np.sqrt(2), rel=1e-9)


def test_forces_are_tared_by_their_first_half_second_and_their_noise_is_what_is_left_there():
    """Of 5 N in all with ±0.3 N about it by windows of 50 ms, then 2 N more; the first row stands by itself."""
    number = np.ceil((TIME - TIME[0]) / 0.05 - 1e-9)
    push = np.zeros((251, 3))
    push[:, 1] = 5.0 + np.where(number <= 10, 0.3 * (-1.0) ** number, 2.0)
    push[0, 1] = 5.0
    found = _capture(MODEL, "a.csv", recorded(TIME, place=DRIFT, wrist=push))
    force = found.measured.force["effector"]
    assert found.sensors == {"effector": "wrist"}
    expected = np.concatenate([[0.0], 0.3 * (-1.0) ** np.arange(1, 11), np.full(40, 2.0)])
    np.testing.assert_allclose(force[:, 1], expected, atol=1e-9)
    assert found.noise["effector"] == pytest.approx(np.sqrt(0.09 / 3), rel=1e-9)
    assert found.carried["effector"] == pytest.approx(np.sqrt((10 * 0.09 + 40 * 4.0) / 51 / 3), rel=1e-9)


def test_one_sensor_a_body_is_used_and_others_are_noted():
    """By name: ``base`` carries the effector, and so would ``wrist``; ``pin`` carries the target."""
    data = recorded(TIME, place=DRIFT, base=0 * DRIFT, wrist=0 * DRIFT, pin=0 * DRIFT).assign(
        {"force.foot.x": ("time", 0.0 * TIME)}
    )
    found = _capture(MODEL, "a.csv", data)
    assert found.sensors == {"effector": "base", "target": "pin"}
    assert "force.wrist is not used: one is enough" in found.notes
    assert "force.foot is not used: not all of x, y, z" in found.notes


@pytest.mark.parametrize(("angle", "noted"), [(0.019, False), (0.021, True)])
def test_a_target_without_inertia_that_turns_by_more_than_20_mrad_is_noted(angle, noted):
    """Half of the samples, all after the start, stand at an angle from those before."""
    turn = about_z(np.where(TIME - 30 > 1.25, angle, 0.0))
    found = _capture(MODEL, "a.csv", recorded(TIME, place=DRIFT, turn=turn))
    assert any("the target turned by" in note for note in found.notes) is noted
    np.testing.assert_allclose(found.setup.target.orientation, [1.0, 0.0, 0.0, 0.0], atol=1e-9)


def ends(seconds):
    return 0.01 * np.arange(round(seconds / 0.01) + 1)


@pytest.mark.parametrize(
    ("time", "words"),
    [
        (ends(1.99), "it lasts 1.99 s; give 2 s of a capture or more"),
        (ends(2.0), ""),
        (0.0499 * np.arange(51), ""),
        (0.051 * np.arange(51), "a sample every 0.051 s; give 20 Hz or more"),
    ],
)
def test_a_recording_is_long_and_quick_enough(time, words):
    data = recorded(time, place=np.tile([0.5, 0.1, 0.0], (len(time), 1)))
    if not words:
        assert _capture(MODEL, "a.csv", data).times[-1] == pytest.approx(time[-1], abs=0.05)
    else:
        with pytest.raises(InputError, match=words):
            _capture(MODEL, "a.csv", data)


def test_the_body_is_the_target_or_the_only_one_whose_position_is_whole():
    time = np.arange(3.0)

    def of(**bodies):
        return xr.Dataset({f"pos.{b}.{a}": ("time", time) for b, axes in bodies.items() for a in axes})

    assert body_of("a.csv", of(block="xyz")) == "block"
    assert body_of("a.csv", of(block="xyz", target="xyz")) == "target"
    assert body_of("a.csv", of(block="xyz", target="xy")) == "block"
    for unclear in (of(block="xyz", other="xyz"), of(target="xz"), of()):
        with pytest.raises(InputError, match=r"pos\.target\.x, \.y and \.z are missing"):
            body_of("a.csv", unclear)


# Sensors


def sensing(sensor_body, force):
    return capture(track(np.zeros((10, 3)), **{sensor_body: force}), noise=0.02, carried=3.0)


@pytest.mark.parametrize(("share", "moved"), [(0.45, False), (0.55, True)])
@pytest.mark.parametrize(("body", "other"), [("effector", "target"), ("target", "effector")])
def test_a_sensor_moves_to_the_other_body_from_half_a_likeness_on(share, moved, body, other):
    """The measurement along x; the simulation has it on the other body at that cosine, and nothing on its own."""
    force = np.tile([2.0, 0.0, 0.0], (10, 1))
    seen = np.tile([share, np.sqrt(1 - share**2), 0.0], (10, 1))
    own = sensing(body, force)
    found = sensed_by(own, track(np.zeros((10, 3)), **{other: seen, body: 0.0 * seen}))
    if not moved:
        assert found is own
        return
    assert found.sensors == {other: "wrist"}
    assert dict(found.measured.force) == {other: pytest.approx(force)}
    assert (found.noise[other], found.carried) == (0.02, {other: 3.0})
    assert found.notes[-1] == f"force.wrist reads the force on the {other}, by its sign"


def test_a_sensor_stays_where_it_is_more_alike_or_where_there_is_no_force():
    force = np.tile([1.0, 0.0, 0.0], (10, 1))
    own = sensing("effector", force)
    assert sensed_by(own, track(np.zeros((10, 3)), target=force, effector=1.1 * force)) is own
    assert sensed_by(own, track(np.zeros((10, 3)), target=0.0 * force, effector=-force)) is own


def test_captures_with_sensors_on_other_bodies_are_not_compared():
    one, other = (sensing(body, np.zeros((10, 3))) for body in ("effector", "target"))
    check_sensors([one, one])
    check_sensors([])
    for unlike in ([one, other], [one, one, other]):
        with pytest.raises(InputError, match=r"a\.csv: its force sensors are not those of a\.csv"):
            check_sensors(unlike)
