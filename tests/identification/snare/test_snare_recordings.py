"""Captures as recordings: model files, what is refused, simulate, identify, and a diagnosis of closed forms."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from captures_by_hand import known
from refusal import refusal

from snarelab.cli import main
from snarelab.errors import InputError
from snarelab.identification.snare.diagnose import diagnose_captures
from snarelab.identification.snare.identify import identify_captures
from snarelab.identification.snare.recording import Track, load_captures, sensed_by
from snarelab.identification.snare.runs import CaptureRuns, Job, simulated
from snarelab.identification.snare.simulate import simulate_capture
from snarelab.identification.snare.source import Captures
from snarelab.models.effects import effects
from snarelab.models.model import places
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model
from snarelab.models.snare.setup import APPLIED, SnareTree

PLAIN = 'name = "capture"\nsystem = "snare_capture"\n'
FAR, SPEED, MASS, LINE = np.array([0.6, 0.3, 0.0]), 0.03, 25.0, 2.0
"""A target out of the cables' reach that swings: closed forms are all there is to it."""


def setup_of(model):
    assert isinstance(model.tree, SnareTree)
    return model.tree.setup


def written(folder, text, name="model.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def swinging(folder, name, columns=None, umbilical=0.0, direction=0.3, seconds=2.5, seed=1, place=FAR):
    """A pendulum on a long line, with an umbilical, pushed at the start: y, z = v/w sin(w t), w^2 = g/l + k/m."""
    time = np.arange(0, seconds + 1e-9, 0.01)
    rate = np.sqrt(9.81 / LINE + umbilical / MASS)
    rng = np.random.default_rng(seed)
    moved = SPEED / rate * np.sin(rate * time)[:, None] * [0.0, np.cos(direction), np.sin(direction)]
    table = {"time": time, "angle.ring": 0.0 * time}
    noise = 5e-5 * rng.normal(size=moved.shape)
    table |= {f"pos.target.{a}": (place + moved + noise)[:, i] for i, a in enumerate("xyz")}
    path = folder / name
    pd.DataFrame(table | (columns or {})).to_csv(path, index=False)
    return path


def test_a_plain_model_is_the_built_in_snare_without_any_effect(tmp_path):
    model = load_model(written(tmp_path, PLAIN))
    setup = setup_of(model)
    assert model.effects == ()
    assert model.joints == ()
    np.testing.assert_array_equal(model.tree.gravity, [-9.81, 0.0, 0.0])
    assert (setup.parameters.friction, setup.parameters.contact_damping, setup.target.umbilical) == (0.0, 0.0, 0.0)
    assert setup.parameters.bending_damping == 1e-3  # no rope has none, no contact is without stiffness
    assert {e.name for e in effects().values() if places(e, model.tree)} == set(APPLIED)


def test_set_up_and_effects_come_back_from_a_saved_model(tmp_path):
    text = PLAIN + (
        'effects = ["contact_friction", { name = "umbilical_stiffness", at = "target", hold = ["stiffness"] }]\n'
        'gravity = [0.0, 0.0, -1.62]\n[capture]\ntarget = "pendulum"\nmass = 12\ninertia = [0.1, 0.2, 0.2]\n'
        'ring_radius = 0.13\nposition = [0.2, 0.05, 0.0]\n[parameters]\n"contact_friction.pin.coefficient" = 0.2\n'
    )
    model = load_model(written(tmp_path, text))
    assert setup_of(model).target.rotates
    assert setup_of(model).target.mass == 12.0
    save_model(model, tmp_path / "saved.toml", "a note")
    again = load_model(tmp_path / "saved.toml")
    assert again.effects == model.effects
    assert again.values == model.values
    assert setup_of(again) == setup_of(model)
    setup = setup_of(model).with_values(model.values)
    assert setup.parameters.friction == 0.2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[capture]\nfriction = 0.1", ("contact_friction", "[parameters]")),
        ("[capture]\numbilical = 0.1", ("umbilical_stiffness",)),
        ("[capture]\nring_radios = 0.1", ("'ring_radios'", "did you mean 'ring_radius'")),
        ('[capture]\ntarget = "moved"', ("'moved'", "spring, pendulum, free")),
        ('[capture]\nmass = "heavy"', ("mass = 'heavy'", "a number")),
        ("[capture]\nposition = [0.0, 1.0]", ("position = [0.0, 1.0]", "a list of 3 numbers")),
        ("[capture]\nmass = -1.0", ("mass is -1.0",)),
        ("[capture]\ncable_length = 0.1", ()),
        ("capture = 3", ("capture = 3", "a table")),
        ('urdf = "arm.urdf"', ("has no urdf", "take it out")),
        ("bandwidth = 3.0", ("has no bandwidth",)),
        ('base = "hub"', ("'base'",)),
        ('inertia = "free"', ("inertia = 'free'",)),
        ("gravity = [0.0, 0.0, 0.0]", ("target = 'free'",)),
        ('effects = ["viscous_friction"]', ("viscous_friction acts at a joint",)),
        ('effects = [{ name = "contact_friction", at = "cables" }]', ("this model has pin",)),
        ('effects = ["hang_point_clearance"]\n[capture]\ntarget = "free"', ("hang_point_clearance",)),
    ],
)
def test_a_mistake_in_a_model_file_is_named(tmp_path, text, words):
    if "cable_length" in text:  # shorter than the way from ring to ring: found when the snare is built
        model = load_model(written(tmp_path, PLAIN + text))
        job = Job(setup_of(model), known(setup_of(model)), None, 3)
        assert simulated(job, {}) is None
        return
    path = written(tmp_path, PLAIN + text)
    refusal(lambda: load_model(path), path, *words)


def test_capture_belongs_to_a_snare(tmp_path):
    with pytest.raises(InputError, match="belongs to system = 'snare_capture'"):
        load_model(written(tmp_path, 'system = "arm"\n[capture]\nmass = 3.0\n'))


def test_what_a_recording_says_of_its_start(tmp_path):
    model = load_model(written(tmp_path, PLAIN))
    force = {f"force.wrist.{a}": np.where(np.arange(251) < 150, 2.0, 5.0) for a in "xyz"}
    path = swinging(tmp_path, "a.csv", {**force, "force.half.x": np.zeros(251)})
    (capture,) = load_captures(model, [path])
    start = capture.setup.target
    # Noise alone gives a cubic's slope at its end over half a second some 16/(0.5 s sqrt(50)) of its size: 0.2 mm/s.
    np.testing.assert_allclose(start.velocity, [0.0, SPEED * np.cos(0.3), SPEED * np.sin(0.3)], atol=1e-3)
    np.testing.assert_allclose(start.position, FAR, atol=1e-4)
    assert capture.sensors == {"effector": "wrist"}
    np.testing.assert_allclose(capture.measured.force["effector"][1:29], 0.0, atol=1e-12)
    np.testing.assert_allclose(capture.measured.force["effector"][-10:], 3.0, atol=1e-12)
    assert any("quat.target is not recorded" in note for note in capture.notes)
    assert any("force.half is not used" in note for note in capture.notes)
    # Means over 50 ms about each time are the motion itself but for its curvature.
    rate = np.sqrt(9.81 / LINE)
    y = FAR[1] + SPEED / rate * np.sin(rate * capture.times) * np.cos(0.3)
    np.testing.assert_allclose(capture.measured.position[1:-1, 1], y[1:-1], atol=1.2e-4)


def turned(table, rate, known=None):
    """Columns of a turn about x at a rate [rad/s], where they are known."""
    known = table.time >= 0 if known is None else known
    half = 0.5 * rate * table.time
    columns = {"w": np.cos(half), "x": np.sin(half), "y": 0.0 * half, "z": 0.0 * half}
    return {f"quat.target.{a}": v.where(known) for a, v in columns.items()}


def test_a_target_that_turns_although_the_model_holds_it_is_noted(tmp_path):
    """0.1 rad/s over 2.5 s, the start a mean over the first half second: 0.225 rad, 13 degrees."""
    table = pd.read_csv(swinging(tmp_path, "a.csv"))
    table.assign(**turned(table, 0.1)).to_csv(tmp_path / "b.csv", index=False)
    (capture,) = load_captures(load_model(written(tmp_path, PLAIN)), [tmp_path / "b.csv"])
    assert any("the target turned by 13 deg" in note and "give [capture] inertia" in note for note in capture.notes)
    rotating = written(tmp_path, PLAIN + "[capture]\ninertia = [0.1, 0.1, 0.1]\n", "turns.toml")
    (capture,) = load_captures(load_model(rotating), [tmp_path / "b.csv"])
    assert not any("turned" in note for note in capture.notes)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.drop(columns="pos.target.y"), "pos.target.x, .y and .z are missing"),
        (lambda t: t[t.time < 1.0], "it lasts"),
        (lambda t: t[::10], "a sample every 0.1 s"),
        (lambda t: t.assign(**{"angle.ring": 0.5}), "ring open"),
        (lambda t: t.assign(**{"pos.target.x": t["pos.target.x"].where(t.time > 0.6)}), "no sample in the first"),
        (lambda t: t.assign(**turned(t, 0.0, t.time > 0.6)), "quat.target has no sample in the first 0.5 s"),
    ],
)
def test_a_recording_that_cannot_be_used_is_named(tmp_path, change, words):
    model = load_model(written(tmp_path, PLAIN))
    table = pd.read_csv(swinging(tmp_path, "a.csv"))
    change(table).to_csv(tmp_path / "b.csv", index=False)
    with pytest.raises(InputError, match=words) as caught:
        load_captures(model, [tmp_path / "b.csv"])
    assert "b.csv" in str(caught.value)


def test_twenty_samples_a_second_are_enough(tmp_path):
    """A clock of 0.05 s in doubles has steps of a little more, too."""
    table = pd.read_csv(swinging(tmp_path, "a.csv"))[::5].assign(time=0.05 * np.arange(51))
    assert np.median(np.diff(table.time)) > 0.05
    table.to_csv(tmp_path / "b.csv", index=False)
    (capture,) = load_captures(load_model(written(tmp_path, PLAIN)), [tmp_path / "b.csv"])
    assert len(capture.times) == 51


def test_captures_are_told_by_forces_on_the_same_bodies(tmp_path):
    model = load_model(written(tmp_path, PLAIN + 'effects = ["umbilical_stiffness"]\n'))
    train, other = swinging(tmp_path, "train.csv"), swinging(tmp_path, "other.csv", seed=2)
    force = {f"force.wrist.{a}": np.zeros(251) for a in "xyz"}
    held = swinging(tmp_path, "held.csv", force, seed=3)
    with pytest.raises(InputError, match=r"held\.csv: its force sensors are not those of .*train\.csv"):
        diagnose_captures(model, [train, other], held, jobs=1)
    with pytest.raises(InputError, match=r"held\.csv: its force sensors are not those of .*train\.csv"):
        identify_captures(model, [train, held, other], jobs=1)


def test_no_processes_are_none_to_simulate_in(tmp_path):
    with pytest.raises(InputError, match="jobs = 0; allowed is a whole number from 1"):
        identify_captures(load_model(written(tmp_path, PLAIN)), [swinging(tmp_path, "train.csv")], jobs=0)


def test_simulate_writes_a_recording_that_is_read_back(tmp_path, capsys):
    text = PLAIN + 'effects = ["contact_friction"]\n'
    model = written(tmp_path, text)
    assert main(["simulate", str(model), "--out", str(tmp_path / "out.csv")]) == 2
    assert "contact_friction.pin.coefficient" in capsys.readouterr().err
    assert not (tmp_path / "out.csv").exists()
    known = '[parameters]\n"contact_friction.pin.coefficient" = 0.1\n'
    model = written(tmp_path, text + "[capture]\nring_rate = 0.6\n" + known)
    motion = swinging(tmp_path, "motion.csv", seconds=2.0)
    out = tmp_path / "out.csv"
    assert main(["simulate", str(model), "--motion", str(motion), "--out", str(out)]) == 0
    table = pd.read_csv(out)
    rate = np.sqrt(9.81 / LINE)
    y = FAR[1] + SPEED / rate * np.sin(rate * table.time) * np.cos(0.3)
    # The start velocity is the recording's, known to a millimetre per second.
    np.testing.assert_allclose(table["pos.target.y"], y, atol=1e-3 / rate)
    (capture,) = load_captures(load_model(model), [out])
    assert capture.sensors == {"effector": "ring", "target": "target"}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 3, 5])
def test_an_umbilical_on_a_pendulum_is_named_and_told_by_its_stiffness(tmp_path, seed):
    """The first half second tells the start velocity to 3 %: twenty times the noise by the recording's end."""
    model = load_model(written(tmp_path, PLAIN + '[capture]\ntarget = "pendulum"\nline_length = 2.0\n'))
    train = swinging(tmp_path, "train.csv", umbilical=80.0, seed=seed, seconds=2.0)
    held = swinging(tmp_path, "held.csv", umbilical=80.0, direction=1.2, seed=seed + 1, seconds=2.0)
    said = []
    diagnosis, after = diagnose_captures(model, [train], held, progress=said.append, jobs=1)
    answer = json.loads(json.dumps(diagnosis.to_json(), allow_nan=False))
    assert answer["verdict"] == "missing_physics"
    assert [e["name"] for e in answer["effects"]] == ["umbilical_stiffness"]
    stiffness = answer["effects"][0]["parameters"]["stiffness"]
    assert stiffness["value"] == pytest.approx(80.0, rel=0.02)
    assert stiffness["unit"] == "N/m"
    fit = answer["fit"]["pos.target.z"]["holdout"]
    assert fit["rms_after"] < 0.2 * fit["rms_before"]
    assert "umbilical stiffness" in answer["sentence"]
    assert said
    save_model(after, tmp_path / "after.toml", diagnosis.sentence)
    along = simulate_capture(load_model(tmp_path / "after.toml"), held)
    truth = pd.read_csv(held)
    known = np.interp(along["time"].values, truth.time, truth["pos.target.z"])
    assert np.sqrt(np.mean((along["pos.target.z"].values - known) ** 2)) < 1e-3


@pytest.mark.slow
def test_a_pendulum_alone_is_told_well_and_what_would_have_shown(tmp_path):
    model = written(tmp_path, PLAIN + '[capture]\ntarget = "pendulum"\nline_length = 2.0\n')
    train, held = (
        swinging(tmp_path, "train.csv", seed=3, seconds=2.0),
        swinging(tmp_path, "held.csv", direction=1.2, seed=4, seconds=2.0),
    )
    out, page = tmp_path / "out.json", tmp_path / "out.html"
    asked = ["diagnose", str(model), str(train), "--holdout", str(held), "--json", str(out), "--report", str(page)]
    assert main([*asked, "--jobs", "1"]) == 0
    answer = json.loads(out.read_text())
    assert answer["verdict"] == "adequate"
    assert answer["effects"] == []
    (limit,) = [x for x in answer["limits"] if x["name"] == "umbilical_stiffness"]
    assert 0 < limit["value"] < 80.0
    assert "adequate" in page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_identify_finds_a_listed_effect(tmp_path):
    text = PLAIN + 'effects = ["umbilical_stiffness"]\n[capture]\ntarget = "pendulum"\nline_length = 2.0\n'
    model = load_model(written(tmp_path, text))
    found = identify_captures(model, [swinging(tmp_path, "train.csv", umbilical=80.0)], jobs=1)
    (parameter,) = found.to_json()["parameters"]
    assert parameter["value"] == pytest.approx(80.0, rel=0.02)
    assert 0 < parameter["std"] < 10.0
    assert not parameter["at_bound"]
    assert found.model.values["umbilical_stiffness.target.stiffness"] == parameter["value"]


@pytest.mark.parametrize(
    "use",
    [lambda m, t, h: identify_captures(m, [t], [h], jobs=1), lambda m, t, h: diagnose_captures(m, [t], h, jobs=1)],
    ids=["identify", "diagnose"],
)
def test_a_held_out_capture_that_starts_inside_a_cable_is_refused(tmp_path, use):
    model = load_model(written(tmp_path, PLAIN + '[capture]\ntarget = "pendulum"\nline_length = 2.0\n'))
    inside = np.array([0.2369, 0.126, 0.0])
    train, held = swinging(tmp_path, "train.csv"), swinging(tmp_path, "held.csv", seed=2, place=inside)
    with pytest.raises(InputError, match="cannot be simulated from where the recording starts") as caught:
        use(model, train, held)
    assert "\n" not in str(caught.value)


def test_a_corrected_number_becomes_part_of_the_set_up(tmp_path):
    model = load_model(written(tmp_path, PLAIN + "[capture]\npin_radius = 0.008\n"))
    source = Captures(model, load_captures(model, [swinging(tmp_path, "a.csv")]), 1, CaptureRuns(()))
    assert {p.effect.name for p in source.library([])} == {*APPLIED, "ring_radius", "mass"}  # what is given, is known
    setup = setup_of(model).corrected({"ring_radius.capture.value": 0.125, "contact_friction.pin.coefficient": 0.3})
    assert setup.parameters.ring_radius == 0.125
    assert setup.parameters.cable_length == pytest.approx(np.hypot(0.1, 2 * np.pi * 0.125 / 3))
    assert setup.parameters.friction == 0.0
    assert isinstance(model.tree, SnareTree)
    save_model(replace(model, tree=replace(model.tree, setup=setup)), tmp_path / "saved.toml", "")
    assert setup_of(load_model(tmp_path / "saved.toml")).parameters == setup.parameters


def test_no_motion_is_planned_for_a_capture(tmp_path, capsys):
    model, train = written(tmp_path, PLAIN), swinging(tmp_path, "train.csv")
    held = swinging(tmp_path, "held.csv", seed=2)
    asked = ["diagnose", str(model), str(train), "--holdout", str(held), "--next-experiment", str(tmp_path / "n.csv")]
    assert main(asked) == 2
    assert "a motion is planned for system = 'arm' only" in capsys.readouterr().err


def test_a_sensor_reads_the_body_that_its_sign_says(tmp_path):
    model = load_model(written(tmp_path, PLAIN))
    push = np.where(np.arange(251) < 150, 0.0, 3.0)
    path = swinging(tmp_path, "a.csv", {f"force.wrist.{a}": push for a in "xyz"})
    (capture,) = load_captures(model, [path])
    force = capture.measured.force["effector"]
    agreeing = Track(capture.measured.position, capture.measured.quaternion, {"effector": force, "target": -force})
    assert sensed_by(capture, agreeing) is capture
    assert sensed_by(capture, None) is capture
    opposed = replace(agreeing, force={"effector": -force, "target": force})
    moved = sensed_by(capture, opposed)
    assert moved.sensors == {"target": "wrist"}
    assert "force on the target" in moved.notes[-1]
