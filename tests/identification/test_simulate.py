"""A saved model, simulated along a motion: what was fitted comes out again, and nothing is made up."""

import json

import numpy as np
import pandas as pd
import pytest

from bench.arm import random_arm
from snarelab.cli import main
from snarelab.errors import InputError
from snarelab.identification.simulate import simulate
from snarelab.models.model_file import load_model
from snarelab.models.rigid_body import RigidBody
from snarelab.models.urdf import load_urdf
from snarelab.recordings import JointKind, read_recording
from snarelab.recordings.condition import condition

KINDS: dict[str, JointKind] = {"joint1": "revolute", "joint2": "prismatic"}
FRICTION = '["viscous_friction", "coulomb_friction", "sensor_bias"]'
MORE = """["viscous_friction", { name = "stribeck_friction", at = "joint1" },
 { name = "sensor_delay", at = "q.joint2" }, { name = "coulomb_friction", at = "joint2", hold = ["level"] }]
[parameters]
"coulomb_friction.joint2.level" = 4.0"""


def motion(seed, seconds=20.0, rate=200.0, speed=1.0):
    """Time (n,) and sums of sines with their derivatives, each (n, 2)."""
    t = np.arange(round(seconds * rate)) / rate
    q, qd, qdd = np.zeros((3, len(t), 2))
    for k, frequency in enumerate((0.31, 0.83, 1.7)):
        for j, size in enumerate((0.8, 0.15)):
            w = 2 * np.pi * frequency * speed * (1 + 0.17 * j + 0.05 * seed)
            a = size / (1 + 2 * k)
            q[:, j] += a * np.sin(w * t + k)
            qd[:, j] += a * w * np.cos(w * t + k)
            qdd[:, j] -= a * w**2 * np.sin(w * t + k)
    return t, q, qd, qdd


def write(path, t, q, tau):
    columns = {"time": t} | {f"q.{j}": q[:, k] for k, j in enumerate(KINDS)}
    pd.DataFrame(columns | {f"tau.{j}": tau[:, k] for k, j in enumerate(KINDS)}).to_csv(path, index=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A revolute joint that carries a prismatic one, with friction, noise, and something no model here has."""
    place = tmp_path_factory.mktemp("simulate")
    for seed in range(100):
        arm = random_arm(np.random.default_rng(seed), 2, 0.5)
        if [link.kind for link in arm.links] == list(KINDS.values()):
            break
    (place / "arm.urdf").write_text(arm.urdf())
    tree = load_urdf(place / "arm.urdf", (0.0, 0.0, -9.81))
    body, rng = RigidBody(tree), np.random.default_rng(0)
    for name, seed in (("train", 0), ("hold", 1)):
        t, q, qd, qdd = motion(seed)
        friction = qd * [6.0, 20.0] + np.sign(qd) * [3.0, 4.0] * (1 + 0.5 * np.exp(-((qd / [0.3, 0.05]) ** 2)))
        tau = body.torque(q, qd, qdd, tree.phi) + friction + 0.3 * np.sin(9 * q) + 0.2 * rng.normal(size=q.shape)
        write(place / f"{name}.csv", t, q, tau)
    for name, effects, more in (
        ("plain", FRICTION, ""),
        ("more", MORE, ""),
        ("free", FRICTION, 'inertia = "free"\n'),
    ):
        (place / f"{name}.toml").write_text(f'name = "{name}"\nurdf = "arm.urdf"\n{more}effects = {effects}\n')
        given = ["identify", place / f"{name}.toml", place / "train.csv", "--holdout", place / "hold.csv"]
        given += ["--json", place / f"{name}.json", "--save-model", place / f"{name}_found.toml"]
        assert main([str(x) for x in given]) == 0
    return place


@pytest.mark.parametrize("name", ["plain", "more", "free"])
@pytest.mark.parametrize("role", ["train", "hold"])
def test_the_saved_model_reproduces_the_fits_residual(folder, name, role):
    """Residual of the recording against the written simulation, in the band: the RMS that identify reported."""
    recording, out = folder / f"{role}.csv", folder / f"{name}_{role}.csv"
    given = ["simulate", folder / f"{name}_found.toml", "--motion", recording, "--out", out]
    assert main([str(x) for x in given]) == 0
    told = json.loads((folder / f"{name}.json").read_text())
    recorded = condition(read_recording(recording, {}, KINDS), list(KINDS), told["band"]["value"])
    simulated = pd.read_csv(out)
    np.testing.assert_allclose(simulated["time"], recorded.time, atol=1e-12)
    for k, joint in enumerate(KINDS):
        residual = recorded.to_band(recorded.tau[:, k] - simulated[f"tau.{joint}"].to_numpy())
        fit = told["fit"][f"tau.{joint}"]["train" if role == "train" else "holdout"]
        assert np.sqrt(np.mean(residual**2)) == pytest.approx(fit["rms"], rel=1e-6)
        assert fit["relative"] < 0.1


def test_what_is_simulated_is_a_recording(folder):
    """Written, read back and identified, it gives the parameters that it was simulated with, and no residual."""
    out = folder / "round.csv"
    given = ["simulate", folder / "plain_found.toml", "--motion", folder / "train.csv", "--out", out]
    assert main([str(x) for x in given]) == 0
    assert list(read_recording(out, {}, KINDS)) == [f"{x}.{j}" for x in ("q", "qd", "qdd", "tau") for j in KINDS]
    assert main(["identify", str(folder / "plain.toml"), str(out), "--json", str(folder / "round.json")]) == 0
    first, again = (json.loads((folder / f"{name}.json").read_text()) for name in ("plain", "round"))
    for a, b in zip(first["parameters"], again["parameters"], strict=True):
        assert b["value"] == pytest.approx(a["value"], rel=0.01, abs=0.01)
    for fit in again["fit"].values():
        assert fit["train"]["relative"] < 2e-3


def test_a_motion_without_torque_gives_the_same(folder):
    lines = [line.split(",") for line in (folder / "train.csv").read_text().splitlines()]
    kept = [i for i, name in enumerate(lines[0]) if not name.startswith("tau.")]
    (folder / "motion.csv").write_text("\n".join(",".join(line[i] for i in kept) for line in lines) + "\n")
    given = load_model(folder / "plain_found.toml")
    with_torque, without = (simulate(given, folder / name) for name in ("train.csv", "motion.csv"))
    for name in with_torque.data_vars:
        np.testing.assert_array_equal(without[name], with_torque[name])


def test_bounds_of_the_training_recording_do_not_bend_values_on_another_motion(folder):
    """The Stribeck speed is bounded by the joint's peak speed in training; a crawl has a lower one."""
    model = load_model(folder / "more_found.toml")
    t, q, qd, qdd = motion(0, 60.0, 200.0, 0.002)
    write(folder / "crawl.csv", t, q, np.ones_like(q))
    answer = simulate(model, folder / "crawl.csv")
    inner = np.searchsorted(t, answer["time"].values - 1e-9)
    load = RigidBody(model.tree).torque(q, qd, qdd, model.tree.phi)[inner, 0]
    v, p = qd[inner, 0], {k.rpartition(".")[2]: x for k, x in model.values.items() if "stribeck_friction.joint1" in k}
    assert p["speed"] > 1.2 * np.abs(v).max()
    level = p["level"] * np.exp(-((v / p["speed"]) ** 2)) * np.tanh(v / (3e-4 * model.values["speed_scale.joint1"]))
    friction = model.values["viscous_friction.joint1.coefficient"] * v + level
    np.testing.assert_allclose(answer["tau.joint1"].values, load + friction, atol=0.02)


def without(folder, line_with):
    """The saved model with some of its values struck out."""
    lines = (folder / "more_found.toml").read_text().splitlines(keepends=True)
    kept = [line for line in lines if not (line.startswith('"') and line_with in line)]
    assert len(kept) < len(lines)
    (folder / "cut.toml").write_text("".join(kept))
    return folder / "cut.toml"


@pytest.mark.parametrize(
    ("struck", "named", "count"),
    [
        ("viscous_friction.joint2", "viscous_friction.joint2.coefficient", 1),
        ("stribeck_friction", "stribeck_friction.joint1.level", 2),
        ("coulomb_friction.joint2.level", "coulomb_friction.joint2.level", 1),  # held, and yet it acts
    ],
)
def test_a_parameter_without_a_value_is_refused(folder, capfd, struck, named, count):
    path, before = without(folder, struck), sorted(folder.iterdir())
    assert main(["simulate", str(path), "--motion", str(folder / "train.csv"), "--out", str(folder / "no.csv")]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    for word in ("cut.toml", f"'{named}'", f"{count} missing", "[parameters]", "identify --save-model"):
        assert word in err
    assert sorted(folder.iterdir()) == before


def test_a_free_inertia_without_values_is_refused(folder):
    with pytest.raises(InputError, match=r"no value for 'inertia\.link1\.mass'"):
        simulate(load_model(folder / "free.toml"), folder / "train.csv")


def test_a_suffix_that_cannot_be_written_is_refused(folder, capfd):
    given = ["simulate", folder / "plain_found.toml", "--motion", folder / "train.csv", "--out", folder / "out.mat"]
    assert main([str(x) for x in given]) == 2
    assert ".csv or .parquet" in capfd.readouterr().err
    assert not (folder / "out.mat").exists()
