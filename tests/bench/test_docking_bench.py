"""The bench on which docking tests are simulated, and each effect there, against statics; its model file."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snarelab.errors import InputError
from snarelab.models.docking.bench import SEEN, DockingBench, DockingCommand
from snarelab.models.docking.bench_setup import GROOVES, Bench, BenchSetup, docking_effects, read_bench
from snarelab.models.docking.closed_forms import seated_stiffness
from snarelab.models.docking.parameters import DockingParameters
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model

ABSENT = DockingParameters(friction=0.0, coulomb=0.0, viscous=0.0, restitution=0.8)
SETUP = BenchSetup(ABSENT)
PRELOAD, BACK, OFF = 0.0573, 0.024, 0.0185
"""Travels [m]: preloaded, unloaded again, and pushed off against the latches."""
LATCH = (5.0, 6.0)
"""At a window's end: what is drawn together there counts once."""


@pytest.fixture(scope="module")
def bench():
    return DockingBench()


def motion(knots, travels, *, latch=LATCH, start=(-0.0801, 0.0, 0.0)):
    """A test whose travel goes from knot to knot with rests of its rate at both ends."""
    times = np.arange(0.0, knots[-1] + 0.01, 0.05)
    k = np.clip(np.searchsorted(knots, times, "right") - 1, 0, len(knots) - 2)
    length = np.diff(knots)[k]
    x = np.clip((times - np.array(knots)[k]) / length, 0, 1)
    gone = np.diff(travels)[k]
    travel = np.array(travels)[k] + gone * x * x * (3 - 2 * x)
    rate = gone / length * 6 * x * (1 - x)
    return DockingCommand(times, travel, rate, np.array(start), np.array([1.0, 0, 0, 0]), latch)


WHOLE = motion([0, 0.5, 3, 6.5, 8.5, 9, 11, 11.5], [0.03, 0.03, PRELOAD, PRELOAD, BACK, BACK, OFF, OFF])


def run(bench, values, given=WHOLE, setup=SETUP):
    seen = bench.run(setup, values, given)
    return {name: seen[:, c] for c, name in enumerate(SEEN)}, 0.5 * (given.times[1:] + given.times[:-1])


def at(seen, times, name, when):
    return float(np.interp(when, times, seen[name]))


def test_a_free_carriage_feels_its_friction_and_its_mass(bench):
    """Nothing touches: level + viscous * speed, and (m + J (2 pi/l)^2) times the acceleration."""
    given = motion([0, 1, 3, 4], [0.0, 0.0, 0.02, 0.02], start=(-0.13, 0.0, 0.0), latch=(1e9, 2e9))
    far = BenchSetup(ABSENT, Bench(knob=0.5))
    values = {"carriage_friction.carriage.level": 30.0, "carriage_friction.carriage.viscous": 500.0}
    seen, times = run(bench, values, given, far)
    p = DockingParameters()
    mass = p.carriage_mass + p.rotor * (2 * np.pi / p.lead) ** 2
    speed, push = 1.5 * 0.01, 6 * 0.02 / 2**2  # of the cubic: in its middle, and at its start
    assert at(seen, times, "tau.carriage", 2.0) == pytest.approx(30.0 + 500.0 * speed, rel=1e-3)
    expected = 30.0 + 500.0 * 0.5 * push * 0.05 + mass * push * (1 - 0.05 / 2)
    assert at(seen, times, "tau.carriage", 1.025) == pytest.approx(expected, rel=0.1)
    assert np.abs(seen["force.target.x"]).max() == 0


def test_the_preload_is_the_cables_and_stays_inside(bench):
    """The motor's force is the cables' stretch; of it the target's load cell feels only what the mount pulls with."""
    seen, times = run(bench, {})
    axial, *_ = seated_stiffness(ABSENT)
    b = SETUP.bench
    pulled = at(seen, times, "tau.carriage", 4.5)
    place = at(seen, times, "pos.effector.x", 4.5)
    stretch = -b.knob - (place - b.ring - PRELOAD) - b.slack
    assert pulled == pytest.approx(b.cable_stiffness * stretch, rel=1e-4)
    assert pulled == pytest.approx(5000, rel=0.1)
    assert place + ABSENT.seat == pytest.approx(pulled / axial, rel=1e-2)
    moved = place - WHOLE.place[0]
    assert at(seen, times, "force.target.x", 4.5) == pytest.approx(-b.mount_stiffness * moved, rel=1e-2)


def test_all_grooves_offset_turn_the_seat(bench):
    """The same offset all round is a turn about the axis by offset over the balls' radius; one alone moves it, too."""
    t = 2e-4
    whole, times = run(bench, {f"groove_misalignment.{g}.offset": t for g in GROOVES})
    assert at(whole, times, "turn.effector.x", 4.5) == pytest.approx(t / ABSENT.radius, rel=2e-2)
    assert abs(at(whole, times, "pos.effector.y", 4.5)) < 2e-6
    one, times = run(bench, {"groove_misalignment.groove1.offset": t})
    # Two flanks a ball: three lateral springs at 120 degrees, one of them moved: 2/3 of it sideways, 1/3 as a turn.
    assert at(one, times, "turn.effector.x", 4.5) == pytest.approx(t / 3 / ABSENT.radius, rel=3e-2)
    sideways = np.hypot(at(one, times, "pos.effector.y", 4.5), at(one, times, "pos.effector.z", 4.5))
    assert sideways == pytest.approx(2 / 3 * t, rel=5e-2)


def test_a_latch_that_loses_preload_pulls_less(bench):
    """Maxwell: after a time t the share 1 - exp(-t/T) of what is lost in the end is gone."""
    still = motion([0, 0.5, 3, 14], [0.03, 0.03, PRELOAD, PRELOAD])
    before, times = run(bench, {}, still)
    after, _ = run(bench, {"preload_loss.latches.share": 0.3, "preload_loss.latches.time": 4.0}, still)
    assert at(before, times, "tension.latch1", 13.0) < ABSENT.latch_preload  # its spring gives way with the seat
    soft = 3 * ABSENT.latch_stiffness / (3 * ABSENT.latch_stiffness + seated_stiffness(ABSENT)[0])
    for when in (7.0, 13.0):
        lost = 0.3 * ABSENT.latch_preload * (1 - np.exp(-(when - LATCH[0]) / 4.0))
        found = at(before, times, "tension.latch1", when) - at(after, times, "tension.latch1", when)
        assert found == pytest.approx(lost * (1 - soft), rel=0.05)


def test_a_loose_latch_holds_after_its_play(bench):
    """Pushed beyond the preload the balls lift by half the play before the latches' stiffness takes them."""
    tight, times = run(bench, {})
    play = 6e-4
    loose, _ = run(bench, {"latch_play.latches.play": play})
    lifted = at(tight, times, "pos.effector.x", 11.4) - at(loose, times, "pos.effector.x", 11.4)
    pulled = at(loose, times, "tension.latch1", 11.4)
    held = pulled - ABSENT.latch_preload  # of the spring, beyond its play
    seat = at(loose, times, "pos.effector.x", 5.0)
    gone = seat - at(loose, times, "pos.effector.x", 11.4)
    assert held > 0
    assert gone == pytest.approx(play / 2 + held / ABSENT.latch_stiffness, abs=1.5e-5)
    assert lifted > 0.2 * play


def test_rubbing_balls_bear_a_part_of_the_preload(bench):
    """Friction holds the seat back while it is loaded: it sits less deep, by at most mu cot(flank) of the load."""
    smooth, times = run(bench, {})
    rough, _ = run(bench, {"docking_friction.grooves.coefficient": 0.2})
    depth = [at(x, times, "pos.effector.x", 4.5) + ABSENT.seat for x in (smooth, rough)]
    assert 0.8 * depth[0] < depth[1] < 0.99 * depth[0]


def test_every_docking_effect_is_found_by_its_place():
    places = docking_effects()
    assert places["groove_misalignment"] == GROOVES
    assert {"carriage_friction", "docking_friction", "latch_play", "preload_loss"} < set(places)
    assert "viscous_friction" not in places


def test_a_start_that_is_turned_keeps_its_turn(bench):
    """Free in its mount nothing moves, whichever way it faces."""
    turn = Rotation.from_rotvec([0.2, -0.1, 0.3]).as_quat(scalar_first=True)
    given = dataclasses.replace(motion([0, 1], [0.0, 0.0], start=(-0.3, 0.01, 0.0), latch=(1e9, 2e9)), quaternion=turn)
    seen, _ = run(bench, {}, given, BenchSetup(ABSENT, Bench(knob=2.0)))
    assert np.abs(seen["turn.effector.z"]).max() < 1e-9
    assert np.abs(seen["pos.effector.y"] - 0.01).max() < 1e-9


def test_a_model_file_is_read_and_written_again(tmp_path):
    path = tmp_path / "docking.toml"
    path.write_text(
        'system = "docking"\neffects = ["docking_friction", "groove_misalignment"]\n[docking]\nmass = 100\n'
        'restitution = 0.8\n[parameters]\n"docking_friction.grooves.coefficient" = 0.2\n'
    )
    model = load_model(path)
    assert [p.key for p in model.effects] == [
        "docking_friction.grooves",
        *(f"groove_misalignment.{g}" for g in GROOVES),
    ]
    tree: Any = model.tree
    assert tree.setup.bench.mass == 100.0
    assert tree.setup.mechanism.friction == 0.0
    save_model(model, tmp_path / "again.toml", "")
    again = load_model(tmp_path / "again.toml")
    written: Any = again.tree
    assert written.setup.values() == tree.setup.values()
    assert again.effects == model.effects


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[docking]\nfriction = 0.1", r"friction belongs to the effect docking_friction; list that"),
        ("[docking]\nmas = 3.0", r"unknown key 'mas' in \[docking\]; .*did you mean 'mass'"),
        ("[docking]\nmass = true", r"mass = True; allowed is a number"),
        ("[docking]\nmass = -1.0", r"\[docking\] mass is -1 kg; give > 0"),
        ("[docking]\nflank = 2.0", r"\[docking\] flank is 2 rad; give more than 0 and < pi/2"),
        ('urdf = "a.urdf"', r"system = 'docking' has no urdf, \[docking\] has its sizes"),
        ("gravity = [0.0, 0.0, -9.81]", r"a docking test hangs balanced: take it out"),
        ("[capture]\nmass = 3.0", r"\[capture\] belongs to system = 'snare_capture'"),
        ('effects = ["viscous_friction"]', r"viscous_friction acts at a joint, and this model has none"),
    ],
)
def test_what_a_docking_cannot_have_is_refused(tmp_path, text, words):
    path = tmp_path / "docking.toml"
    path.write_text(f'system = "docking"\n{text}\n')
    with pytest.raises(InputError, match=words):
        load_model(path)


def test_nothing_given_is_the_built_in_bench(tmp_path):
    assert (
        read_bench(tmp_path / "x.toml", "x", None).setup.values()
        == BenchSetup(DockingParameters(friction=0.0, coulomb=0.0, viscous=0.0)).values()
    )
