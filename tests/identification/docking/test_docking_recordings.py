"""Docking recordings: what is read of them, what is refused, and what a diagnosis says of one by another engine."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from bench.docking_concealed import EFFECTS, program, run_case
from snarelab.errors import InputError
from snarelab.identification.diagnose import diagnose
from snarelab.identification.docking.noise import slid
from snarelab.identification.docking.recording import EVERY, load_records
from snarelab.identification.docking.runs import SHIFTS, DockingRuns
from snarelab.identification.identify import identify
from snarelab.identification.simulate import simulate
from snarelab.models.docking.bench import NEVER
from snarelab.models.model_file import load_model

RATE = 200.0


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "docking.toml"
    path.write_text(
        'system = "docking"\neffects = ["carriage_friction", "docking_friction"]\n'
        "[docking]\nrestitution = 0.8\nknob = 0.6\n"
        '[parameters]\n"carriage_friction.carriage.level" = 20.0\n"carriage_friction.carriage.viscous" = 200.0\n'
        '"docking_friction.grooves.coefficient" = 0.15\n'
    )
    return load_model(path)


def told(duration: float = 3.0, changed: dict[str, Any] | None = None) -> dict[str, Any]:
    """A carriage that moves at 5 mm/s from 0.5 s on, the end effector at rest before the grooves."""
    time = np.arange(0.0, duration, 1 / RATE)
    columns = {"time": time + 7.0, "q.carriage [m]": 0.005 * np.clip(time - 0.5, 0, None), "tau.carriage [N]": 0 * time}
    columns |= {f"pos.effector.{a}": np.full(len(time), x) for a, x in zip("xyz", (-0.13, 0.002, 0.0), strict=True)}
    columns |= {f"quat.effector.{a}": np.full(len(time), float(a == "w")) for a in "wxyz"}
    columns |= {"force.target.x": 0 * time, "closed.latches": np.clip((time - 1.0) / 0.8, 0, 1)}
    return columns | (changed or {})


def written(tmp_path, columns, name="a.csv"):
    pd.DataFrame(columns).to_csv(tmp_path / name, index=False)
    return tmp_path / name


def test_a_recording_gives_the_travel_the_latches_and_the_start(tmp_path, model):
    (record,) = load_records(model, [written(tmp_path, told())])
    m = record.motion
    assert record.channels == (
        *(f"pos.effector.{a}" for a in "xyz"), *(f"turn.effector.{a}" for a in "xyz"), "force.target.x", "tau.carriage"
    )  # fmt: skip
    assert record.zero == 7.0
    np.testing.assert_allclose(np.interp([0.3, 2.0], m.times, m.travel), [0.0, 0.0075], atol=1e-7)
    np.testing.assert_allclose(np.interp([0.3, 2.0], m.times, m.rate), [0.0, 0.005], atol=1e-6)
    np.testing.assert_allclose(m.latch, (1.0, 1.8), atol=2e-3)
    np.testing.assert_allclose(m.place, [-0.13, 0.002, 0.0])
    assert record.measured.shape == (len(record.times) - 1, 8)
    assert len(m.times) - 1 == 2 * (len(record.times) - 1)


def test_means_are_over_their_windows(tmp_path, model):
    time = np.arange(0.0, 3.0, 1 / RATE)
    (record,) = load_records(model, [written(tmp_path, told(changed={"tau.carriage [N]": 10 * time}))])
    # Samples of a window are those after its begin, up to its end.
    middles = EVERY * (np.arange(len(record.times) - 1) + 0.5) + 0.5 / RATE
    np.testing.assert_allclose(record.measured[:, record.channels.index("tau.carriage")], 10 * middles, atol=1e-9)


def test_seats_have_slid_once_the_carriage_moved_under_closed_latches(tmp_path, model):
    (record,) = load_records(model, [written(tmp_path, told())])
    ends = record.times[1:]
    np.testing.assert_array_equal(slid(record), ends > record.motion.latch[1])
    time = told()["time"] - 7.0
    stood = 0.005 * np.clip(time - 0.5, 0.0, 0.7)
    (still,) = load_records(model, [written(tmp_path, told(changed={"q.carriage [m]": stood}), "b.csv")])
    assert not slid(still).any()


def test_latches_that_were_not_recorded_stay_open(tmp_path, model):
    columns = told()
    del columns["closed.latches"]
    (record,) = load_records(model, [written(tmp_path, columns)])
    assert record.motion.latch[0] == NEVER


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"q.carriage [m]": None}, r"q\.carriage is missing; a docking test is told by"),
        ({"quat.effector.w": None}, r"quat\.effector\.w is missing"),
        ({"closed.latches": np.linspace(1, 0, 600)}, r"closed\.latches must rise from 0 \(open\) to 1"),
        ({"closed.latches": np.linspace(0.0, 0.5, 600)}, r"closed\.latches goes from 0 to 0\.5; record all"),
    ],
)
def test_what_is_missing_or_cannot_be_is_refused(tmp_path, model, changed, words):
    columns = {k: v for k, v in (told() | changed).items() if v is not None}
    with pytest.raises(InputError, match=words):
        load_records(model, [written(tmp_path, columns)])


def test_too_short_too_slow_and_unlike_recordings_are_refused(tmp_path, model):
    with pytest.raises(InputError, match=r"it lasts 0\.995 s; give 2 s"):
        load_records(model, [written(tmp_path, told(1.0))])
    with pytest.raises(InputError, match=r"a sample every 0\.05 s; give 80 Hz"):
        load_records(model, [written(tmp_path, {k: v[::10] for k, v in told().items()})])
    other = told()
    del other["tau.carriage [N]"]
    paths = [written(tmp_path, told()), written(tmp_path, other, "b.csv")]
    with pytest.raises(InputError, match=r"tau\.carriage is not in all recordings"):
        load_records(model, paths)
    gap = np.where(np.abs(np.arange(600) - 300) < 20, np.nan, told()["q.carriage [m]"])
    with pytest.raises(InputError, match=r"q\.carriage has a gap at 1\.4"):
        load_records(model, [written(tmp_path, told(changed={"q.carriage [m]": gap}), "c.csv")])
    apart = written(tmp_path, told(4.0), "d.csv")
    with pytest.raises(InputError, match="jobs = 2; only captures"):
        diagnose(model, [paths[0]], apart, jobs=2)


def test_a_simulation_follows_the_test_and_is_remembered(tmp_path, model):
    path = written(tmp_path, told())
    seen = simulate(model, path)
    assert seen["tau.carriage"].sel(time=9.0, method="nearest") == pytest.approx(20.0 + 200.0 * 0.005, rel=1e-3)
    records = load_records(model, [path])
    runs = DockingRuns(model.tree.setup, records)
    once = runs(0, dict(model.values), np.zeros(len(SHIFTS)))
    again = runs(0, dict(model.values), np.zeros(len(SHIFTS)))
    assert runs.count == 1
    np.testing.assert_array_equal(once, again)
    moved = runs(0, dict(model.values), np.eye(len(SHIFTS))[SHIFTS.index("register.y")])
    assert once is not None
    assert moved is not None
    # The pose is as it was measured: its registration does not move what nothing touches.
    np.testing.assert_allclose(moved[:, 1], once[:, 1], atol=1e-9)


def test_a_carriages_friction_is_identified_from_its_closed_form(tmp_path, model):
    """Nothing touches, and the motor's force is level + coefficient * speed at two speeds."""
    rng = np.random.default_rng(1)
    time = told()["time"] - 7.0
    paths = []
    for name, slow in (("a.csv", 0.002), ("b.csv", 0.004)):
        rate = np.where(time < 0.5, 0.0, np.where(time < 1.6, 0.008, slow))
        travel = np.concatenate([[0.0], np.cumsum(rate)[:-1] / RATE])
        motor = np.where(rate > 0, 35.0 + 900.0 * rate, 0.0) + 0.2 * rng.normal(size=len(time))
        changed = {"q.carriage [m]": travel, "tau.carriage [N]": motor}
        columns = told(changed=changed)
        paths.append(written(tmp_path, {k: x for k, x in columns.items() if k != "closed.latches"}, name))
    free = replace(model, values={k: x for k, x in model.values.items() if k.startswith("docking_friction")})
    found = identify(free, paths[:1], paths[1:])
    said = found.to_json()
    by_name = {p["name"]: p for p in said["parameters"] if p["effect"] == "carriage_friction"}
    for name, truth in (("level", 35.0), ("viscous", 900.0)):
        assert by_name[name]["value"] == pytest.approx(truth, rel=0.1)
        assert abs(by_name[name]["value"] - truth) < 4 * by_name[name]["std"]
    assert said["fit"]["tau.carriage"]["holdout"]["relative"] < 0.1
    assert found.model.values["carriage_friction.carriage.level"] == by_name["level"]["value"]


def test_presliding_is_known_to_a_factor_and_stays_above_zero(tmp_path, model, monkeypatch):
    """A deviation is a factor of e either way: five below are still a length, where a sum would have gone below 0."""
    given = []

    class Kept:
        def run(self, setup, values, motion):
            given.append(values["breakaway"])
            return np.zeros((len(motion.times) - 1, 16))

    monkeypatch.setattr("snarelab.identification.docking.runs._bench", Kept)
    runs = DockingRuns(model.tree.setup, load_records(model, [written(tmp_path, told())]))
    one = np.eye(len(SHIFTS))[SHIFTS.index("breakaway")]
    for shift in (1.0, -1.0, -5.0):
        runs.seen(0, dict(model.values), shift * one)
    said = model.tree.setup.mechanism.breakaway
    np.testing.assert_allclose(given, said * np.exp([1.0, -1.0, -5.0]))


def test_programs_of_the_proof_preload_and_push_off():
    travel, duration, (begun, closed) = program(np.random.default_rng(3))
    at = np.array([travel(t) for t in np.arange(0.0, duration, 0.01)])
    assert at[0] == pytest.approx(0.004)
    assert 0.0573 <= at.max() <= 0.0582
    assert begun < closed < duration
    assert np.abs(np.diff(at)).max() < 1.6e-4


@pytest.fixture(scope="module")
def sliding(tmp_path_factory):
    """What a diagnosis says of MuJoCo's docking whose friction the model does not have."""
    return run_case("docking_friction", 1, tmp_path_factory.mktemp("docking"))


@pytest.mark.slow
def test_an_effect_concealed_in_mujoco_is_named_alone(sliding):
    assert "docking_friction" in EFFECTS
    assert sliding["right"], sliding


@pytest.mark.slow
def test_friction_concealed_in_mujoco_has_its_size(sliding):
    assert sliding["found"]["coefficient"] == pytest.approx(sliding["truth"]["coefficient"], rel=0.25)
