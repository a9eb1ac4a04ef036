"""Motor and link encoder of arms that MuJoCo moved: what makes the two differ is named, and nothing else is.

Delays, scales and zeros are put on the link's encoder with splines and plain arithmetic, springs and play are MuJoCo's:
none of it is snarelab's own law.
"""

import json
import zipfile

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from bench.arm import random_arm
from bench.lugre import LuGre
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Elasticity
from snarelab.cli import main
from snarelab.identification.diagnose import diagnose
from snarelab.identification.fitting.experiment import load_experiments, scales
from snarelab.identification.fitting.fit import fit
from snarelab.identification.links.diagnose import diagnose_links
from snarelab.identification.search.refit import assemble
from snarelab.identification.sources.answer import rms
from snarelab.models.model_file import load_model
from snarelab.models.rigid_body import RigidBody

JOINTS = ("joint1", "joint2")
NOISE = 1e-5
"""[rad] Of the link's encoder, RMS."""
SECONDS = 6.0
"""Of each motion: long enough for every name."""


def record(folder, seed=5, **concealed):
    """Three motions of a random two-joint arm with friction and both encoders, and its model file."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng, 2)
    plant = Plant(
        arm,
        friction={"joint1": LuGre(level=8.0, viscous=6.0), "joint2": LuGre(level=5.0, viscous=4.0)},
        encoder_noise=dict.fromkeys(JOINTS, 1e-6),
        tau_noise=dict.fromkeys(JOINTS, 0.1),
        **concealed,
    )
    (folder / "arm.urdf").write_text(arm.urdf())
    (folder / "arm.toml").write_text(
        'name = "arm"\nurdf = "arm.urdf"\neffects = ["viscous_friction", "coulomb_friction", "presliding_hysteresis"]\n'
    )
    motions = [kind(arm, rng, SECONDS) for kind in (fourier_motion, fourier_motion, point_to_point_motion)]
    settings = {"timestep": 5e-4, "settle": 0.5, "link_encoder": True}
    return [simulate(plant, m, SECONDS, 200.0, rng, **settings) for m in motions]


def write(folder, recordings, seed=0, change=lambda time, link: link, at="joint2"):
    """Write recordings with noise on the link encoders, one of them changed."""
    rng = np.random.default_rng(seed)
    paths = []
    for number, recording in enumerate(recordings):
        made = dict(recording)
        made[f"q_link.{at}"] = change(made["time"], made[f"q_link.{at}"])
        for joint in JOINTS:
            made[f"q_link.{joint}"] = made[f"q_link.{joint}"] + NOISE * rng.standard_normal(len(made["time"]))
        paths.append(folder / f"{number}.csv")
        write_csv(paths[-1], made)
    return paths


def links_of(folder, paths):
    """The encoders' diagnosis beside a fit of the torques, without the torques' search."""
    model = load_model(folder / "arm.toml")
    body = RigidBody(model.tree)
    train = load_experiments(model, paths[:2], body)
    found = fit(assemble(model, None, scales(train)), train)
    one = diagnose_links(
        model, paths[:2], paths[2], body, found.assembly, found.theta, scales(train), train[0].motion.band
    )
    assert one is not None
    return one


def named(one, at="joint2"):
    return [n.placed.key for n in one.decided.best.names if one.links.joints[n.channels[0]] == at]


def parameters(one, name, at="joint2"):
    values = one.decided.train.at.all_values
    return {k.rpartition(".")[2]: v for k, v in values.items() if k.startswith(f"{name}.") and f"{at}." in k}


@pytest.fixture(scope="module")
def rigid(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rigid")
    return folder, record(folder)


def test_alike_encoders_are_left_alone(rigid, tmp_path):
    folder, recordings = rigid
    for seed in range(2):
        one = links_of(folder, write(tmp_path, recordings, seed))
        assert [named(one, j) for j in JOINTS] == [[], []]
        assert np.all(rms(one.decided.held) < NOISE)
        assert one.decided.left.curves == ()


SLOW = pytest.mark.slow
"""What `test_links_decided.py` holds with every run: the same law on one joint, its data by another solver."""


@pytest.mark.parametrize(
    ("change", "key", "parameter", "value", "within"),
    [
        pytest.param(
            lambda t, q: CubicSpline(t, q)(t - 0.003), "sensor_delay.q_link.joint2", "delay", 0.003, 0.02, id="late"
        ),
        pytest.param(
            lambda t, q: CubicSpline(t, q)(t + 0.002), "sensor_delay.q.joint2", "delay", 0.002, 0.03, id="early"
        ),
        pytest.param(lambda t, q: 1.001 * q, "sensor_gain.q_link.joint2", "error", 0.001, 0.02, id="scale", marks=SLOW),
        pytest.param(
            lambda t, q: q + 2e-5 * t, "sensor_drift.q_link.joint2", "rate", 2e-5, 0.05, id="drift", marks=SLOW
        ),
    ],
)
def test_a_sensor_fault_is_named_with_its_size(rigid, tmp_path, change, key, parameter, value, within):
    folder, recordings = rigid
    one = links_of(folder, write(tmp_path, recordings, change=change))
    assert named(one, "joint1") == []
    assert named(one) == [key]
    assert one.decided.left.curves == ()
    assert parameters(one, key.partition(".")[0])[parameter] == pytest.approx(value, rel=within)


def test_a_zero_is_a_bias_only_where_it_stays(rigid, tmp_path):
    folder, recordings = rigid
    one = links_of(folder, write(tmp_path, recordings, change=lambda t, q: q - 0.002))
    assert named(one) == ["sensor_bias.q_link.joint2"]
    assert parameters(one, "sensor_bias")["offset"] == pytest.approx(-0.002, rel=0.01)
    zeros = iter((0.002, 0.0015, -0.001))  # referenced anew before the last
    assert named(links_of(folder, write(tmp_path, recordings, change=lambda t, q: q + next(zeros)))) == []


@pytest.mark.parametrize("gap", [pytest.param(0.0, marks=SLOW), 8e-4])
def test_a_spring_is_told_from_a_delay_and_from_play(tmp_path, gap):
    spring = Elasticity(4e4, 40.0, gap)
    recordings = record(tmp_path, elasticity={"joint2": spring}, armature={"joint2": 1.0})
    one = links_of(tmp_path, write(tmp_path, recordings))
    assert named(one, "joint1") == []
    assert named(one)[0] in ("joint_elasticity.joint2", "backlash.joint2")
    if gap:
        assert parameters(one, "backlash")["gap"] == pytest.approx(gap, rel=0.1)
    else:
        assert parameters(one, "joint_elasticity")["stiffness"] == pytest.approx(4e4, rel=0.1)


@pytest.mark.usefixtures("compiler")
def test_whole_answer_and_saved_model(rigid, tmp_path):
    folder, recordings = rigid
    paths = write(tmp_path, recordings, change=lambda t, q: CubicSpline(t, q)(t - 0.003) + 0.002)
    out, saved = tmp_path / "out.json", folder / "new.toml"
    wanted = ["--json", str(out), "--report", str(tmp_path / "out.html"), "--save-model", str(saved)]
    files = [str(p) for p in paths]
    assert main(["diagnose", str(folder / "arm.toml"), *files[:2], "--holdout", files[2], *wanted]) == 0
    found = json.loads(out.read_text())
    assert found["verdict"] == "missing_physics"
    assert [(e["name"], e["at"]) for e in found["effects"]] == [
        ("sensor_delay", "q_link.joint2"),
        ("sensor_bias", "q_link.joint2"),
    ]
    assert "3 ms" in found["sentence"]
    assert found["fit"]["q_link.joint2"]["unit"] == "rad"
    after = found["fit"]["q_link.joint2"]["holdout"]
    assert after["rms_after"] < 0.05 * after["rms_before"]
    assert found["location"][0]["channel"] == "q_link.joint2"
    assert sum(p["share"] for p in found["location"]) <= 1 + 1e-9
    limits = {(x["name"], x["at"]): x["value"] for x in found["limits"]}
    assert 0 < limits["sensor_delay", "q_link.joint1"] < 1e-4
    assert "q_link.joint2" in (tmp_path / "out.html").read_text()
    # The saved model holds delay and zero: nothing is left to say, and the torques are fitted as before.
    again = diagnose(load_model(saved), paths[:2], paths[2]).diagnosis
    assert again.verdict == "adequate"
    assert again.effects == ()
    assert main(["identify", str(saved), files[0], "--json", str(tmp_path / "identified.json")]) == 0
    # An FMU of it reads the late encoder beside the true position.
    assert main(["export", str(saved), "--fmi", "3", "--out", str(tmp_path / "arm.fmu")]) == 0
    with zipfile.ZipFile(tmp_path / "arm.fmu") as fmu:
        assert b'"sensor.q_link.joint2"' in fmu.read("modelDescription.xml")
