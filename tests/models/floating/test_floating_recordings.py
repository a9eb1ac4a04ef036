"""Recordings of a free-floating arm that MuJoCo made: what identify and diagnose find in them."""

# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
import pytest
import xarray as xr

from bench.drake_servicer import model
from snarelab.errors import InputError
from snarelab.identification.arms.beside.masses import regressor_columns
from snarelab.identification.arms.whole_mass import by_mass
from snarelab.identification.diagnose import diagnose
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.experiment import load_experiments, scales
from snarelab.identification.identify import identify
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model
from snarelab.models.regressor import OWN
from snarelab.models.rigid_body import RigidBody
from snarelab.recordings import write_recording

PERIOD, STEP = 0.02, 0.002
MJCF = """<mujoco><option timestep="{step}" gravity="0 0 0" integrator="RK4"/><worldbody>
<body name="hub"><freejoint/>{hub}
<body pos="0.6 0.2 0.1"><joint name="shoulder" axis="0 0 1"/><inertial pos="0.6 0 0" mass="20"
 diaginertia="0.3 2.5 2.5"/>
<body pos="1.2 0 0"><joint name="elbow" axis="0 1 0"/><inertial pos="0.5 0 0" mass="15" diaginertia="0.2 1.4 1.4"/>
</body></body></body></worldbody></mujoco>"""
RIGID = '<inertial pos="0.1 0 0.05" mass="400" diaginertia="90 120 100"/>'
PANELS = """<inertial pos="0.1 0 0.05" mass="399.999" diaginertia="78 112 92"/><body pos="0.1 0 0.05">
<joint name="panels" axis="1 0 0" stiffness="{k}" damping="{c}"/><inertial pos="0 0 0" mass="0.001"
 diaginertia="12 8 8"/></body>"""
JOINTS = ("shoulder", "elbow")
NOISE = {"q": 1e-6, "tau": 0.02, "vel": 2e-6, "omega": 2e-6}


def recorded(path, seed, torque=(0.0, 0.0, 0.0), friction=0.0, hub=RIGID, planar=False, name="hub", seconds=30.0):
    """Servo both joints along sines, with a torque on the base in its own axes and Coulomb friction in the shoulder.

    ``planar`` keeps all motion in a plane, exactly.
    """
    text = MJCF.format(step=STEP, hub=hub)
    plant = mujoco.MjModel.from_xml_string(in_a_plane(text) if planar else text)
    data, rng = mujoco.MjData(plant), np.random.default_rng(seed)
    at = [plant.joint(name).qposadr[0] for name in JOINTS], [plant.joint(name).dofadr[0] for name in JOINTS]
    periods, phases = rng.uniform(5, 9, (2, 2)), rng.uniform(0, 2 * np.pi, (2, 2))
    drive = np.zeros(2)
    every, rows = round(PERIOD / STEP), []
    for k in range(round(seconds / STEP)):
        turn = 2 * np.pi * data.time / periods + phases
        ramp = min(data.time / 3, 1.0)
        target = ramp * np.sum([[0.5, 0.3], [0.5, 0.3]] * np.sin(turn), axis=1)
        q, qd = data.qpos[at[0]], data.qvel[at[1]]
        last = drive
        drive = 300 * (target - q) - 150 * qd
        slip = friction * np.tanh(qd[0] / 1e-3)
        data.qfrc_applied[:] = 0.0
        data.qfrc_applied[3:6] = torque  # MuJoCo's free joint: moment in the body's axes
        data.qfrc_applied[at[1]] = drive - [slip, 0.0]
        # A step holds its torque: at the step's start the mean of two is what acts.
        if k % every == 0:
            mujoco.mj_forward(plant, data)
            turned = np.zeros(9)
            mujoco.mju_quat2Mat(turned, data.qpos[3:7])
            omega = turned.reshape(3, 3) @ data.qvel[3:6]
            rows.append(np.concatenate([[data.time], q, (last + drive) / 2, data.qvel[:3], omega, data.qpos[3:7]]))
        mujoco.mj_step(plant, data)
    names = [f"q.{j}" for j in JOINTS] + [f"tau.{j}" for j in JOINTS]
    names += [f"{kind}.{name}.{a}" for kind in ("vel", "omega") for a in "xyz"] + [f"quat.{name}.{a}" for a in "wxyz"]
    table = np.array(rows)
    still = np.ptp(table[:, 1:], axis=0) < 1e-12 if planar else np.zeros(len(names), bool)
    columns = {}
    for signal, x, rests in zip(names, table[:, 1:].T, still, strict=True):
        noise = 0.0 if rests else NOISE.get(signal.split(".")[0], 0.0)
        columns[signal] = ("time", (np.round(x, 12) if rests else x) + noise * rng.normal(size=len(x)))
    write_recording(xr.Dataset(columns, coords={"time": table[:, 0]}), path)
    return path


def in_a_plane(text):
    """A description, MuJoCo's or a URDF, with nothing above or below the plane, and every axis upright."""
    for old, new in (
        ('axis="0 1 0"', 'axis="0 0 1"'),
        ('axis xyz="0 1 0"', 'axis xyz="0 0 1"'),
        ("0.1 0 0.05", "0.1 0 0"),
        ("0.6 0.2 0.1", "0.6 0.2 0"),
    ):
        text = text.replace(old, new)
    return text


@pytest.mark.slow
def test_external_torque_is_named(tmp_path):
    torque = (0.1, -0.05, 0.2)
    train, held = (recorded(tmp_path / f"{k}.csv", k, torque) for k in (1, 2))
    found = diagnose(model(tmp_path), [train], held).diagnosis
    assert [(e.name, e.at) for e in found.effects] == [("external_torque", "base")]
    got = found.effects[0].parameters
    np.testing.assert_allclose([got[a].value for a in "xyz"], torque, atol=1e-3)
    assert {place.channel for place in found.location} <= {f"torque.hub.{a}" for a in "xyz"}


def test_rigid_body_is_adequate_and_reads_back(tmp_path):
    train, held = (recorded(tmp_path / f"{k}.csv", k) for k in (1, 2))
    believed = model(tmp_path)
    assert diagnose(believed, [train], held).diagnosis.verdict == "adequate"
    fits = identify(believed, [train]).to_json()["fit"]
    assert all(fits[f"torque.hub.{a}"]["train"]["relative"] < 2e-3 for a in "xyz")
    save_model(believed, tmp_path / "again.toml", "")
    again = load_model(tmp_path / "again.toml")
    assert again.joints == believed.joints
    np.testing.assert_array_equal(again.tree.phi, believed.tree.phi)


def test_momentum_says_nothing_of_the_whole_mass(tmp_path):
    """The base's channels do not change when every inertial parameter grows by a share, whatever acts on the base."""
    believed = model(tmp_path)
    body = RigidBody(believed.tree)
    train = load_experiments(believed, [recorded(tmp_path / "1.csv", 1, (0.1, -0.05, 0.2), seconds=10.0)], body)
    assembly = TorqueModel(believed.tree, [], None, scales(train), {})
    phi = assembly.phi
    for c in range(believed.tree.n_joints):
        at, felt = regressor_columns(train[0], c)
        scale = by_mass(assembly, train[0], c)
        assert (scale is None) == (c >= 6)
        if scale is not None:
            change = felt @ phi[at] + scale * phi[at][at % OWN == 0].sum()
            assert np.abs(change).max() < 1e-9 * np.abs(felt @ phi[at]).max()


@pytest.mark.slow
def test_friction_shows_at_its_joint_only(tmp_path):
    train, held = (recorded(tmp_path / f"{k}.csv", k, friction=1.0) for k in (1, 2))
    found = diagnose(model(tmp_path), [train], held).diagnosis
    assert ("coulomb_friction", "shoulder") in [(e.name, e.at) for e in found.effects]
    assert {place.channel for place in found.location} == {"tau.shoulder"}


@pytest.mark.slow
def test_bending_panels_are_named(tmp_path):
    w = 2 * np.pi * 0.35
    hub = PANELS.format(k=12 * w**2, c=12 * 2 * 0.02 * w)
    train, held = (recorded(tmp_path / f"{k}.csv", k, hub=hub, seconds=60.0) for k in (1, 2))
    found = diagnose(model(tmp_path), [train], held).diagnosis
    assert [(e.name, e.at) for e in found.effects] == [("flexible_appendage", "base")]
    got = found.effects[0].parameters
    assert got["frequency"].value == pytest.approx(0.35, rel=0.02)
    assert got["inertia_x"].value == pytest.approx(12.0, rel=0.05)


def test_bad_input(tmp_path):
    train = recorded(tmp_path / "1.csv", 1)
    with pytest.raises(InputError, match=r"no signal 'quat.craft.w' of the floating base"):
        identify(model(tmp_path, base="craft"), [train])
    with pytest.raises(InputError, match="nothing to hold it would fall"):
        model(tmp_path, "gravity = [0.0, 0.0, -9.81]")


def test_what_carries_the_base_has_no_encoder(tmp_path):
    for carrier in model(tmp_path).tree.joints[:6]:
        for kind in ("q", "q_link"):
            with pytest.raises(InputError, match=rf"at '{kind}\.{carrier.name}'; this model has .*q\.shoulder"):
                model(tmp_path, f'effects = [{{ name = "sensor_delay", at = "{kind}.{carrier.name}" }}]')


@pytest.mark.parametrize("torque", [pytest.param(0.0, marks=pytest.mark.slow), 0.2])
def test_a_base_in_a_plane_is_silent_out_of_it(tmp_path, torque):
    """Its velocity and spin out of the plane are zero to the last digit, and so are the channels made of them."""
    train, held = (recorded(tmp_path / f"{k}.csv", k, (0.0, 0.0, torque), planar=True, name="bus") for k in (1, 2))
    model(tmp_path)
    urdf = tmp_path / "servicer.urdf"
    urdf.write_text(in_a_plane(urdf.read_text()))
    (tmp_path / "plane.toml").write_text('name = "plane"\nsystem = "free_floating_arm"\nurdf = "servicer.urdf"\n')
    found = diagnose(load_model(tmp_path / "plane.toml"), [train], held).diagnosis
    assert [(e.name, e.at) for e in found.effects] == [("external_torque", "base")] * bool(torque), found.sentence
    silent = [f"force.base.{a}" for a in "z"] + [f"torque.base.{a}" for a in "xy"]
    assert any("force.base.z, torque.base.x, torque.base.y: zero in every row" in note for note in found.notes)
    assert any("the base is taken to be 'bus'" in note for note in found.notes)
    errors = {f.channel: f for f in found.fit}
    assert max(errors[c].holdout.relative_before for c in silent) < 1e-5
    assert [place.channel for place in found.location] == ["torque.base.z"] * bool(torque)


def test_a_base_with_a_name_of_its_own_needs_no_key(tmp_path):
    model(tmp_path)
    (tmp_path / "m.toml").write_text('system = "free_floating_arm"\nurdf = "servicer.urdf"\n')
    path = recorded(tmp_path / "1.csv", 1, name="spacecraft")
    given = load_model(tmp_path / "m.toml")
    assert "force.base.x" in identify(given, [path]).to_json()["fit"]
    named = load_model(written(tmp_path, 'base = "spacecraft"'))
    assert "torque.spacecraft.z" in identify(named, [path]).to_json()["fit"]
    with pytest.raises(InputError, match=r"no signal 'quat\.bus\.w' of the floating base"):
        identify(load_model(written(tmp_path, 'base = "bus"')), [path])


def written(folder, line):
    (folder / "n.toml").write_text(f'system = "free_floating_arm"\nurdf = "servicer.urdf"\n{line}\n')
    return folder / "n.toml"
