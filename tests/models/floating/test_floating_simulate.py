"""``snarelab simulate`` of a floating base: Drake's base goes where ours does, and what is written reads back."""

import json

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from bench.drake_servicer import Tank, Wheel, model, record
from snarelab.cli import main
from snarelab.errors import InputError
from snarelab.identification.identify import identify
from snarelab.identification.simulate import simulate
from snarelab.models.floating.dynamics import world_momentum
from snarelab.models.floating.ets_vii import ets_vii
from snarelab.models.model_file import load_model
from snarelab.recordings import read_recording, write_recording

SLOSH = dict.fromkeys(("mass_x", "mass_y", "mass_z"), 40.0)
SLOSH |= {"x": -0.4, "y": 0.3, "z": 0.5, "frequency": 0.25, "damping": 0.05}
WHEEL = dict.fromkeys(("loss_x", "loss_y", "coulomb_x", "coulomb_y"), 0.0)
WHEEL |= {"loss_z": 0.02, "coulomb_z": 0.01, "inertia": 0.1}


def written(effect, values):
    lines = [f'"{effect}.base.{name}" = {value}' for name, value in values.items()]
    return "\n".join([f'effects = ["{effect}"]', "[parameters]", *lines])


def stack(table, kind, axes="xyz"):
    return np.stack([table[f"{kind}.{a}"].values for a in axes], axis=1)


CASES = {
    # the joints' path has been through the conditioning's filters
    "rigid": ({}, "", 1e-4),
    "slosh": ({"tank": Tank(40.0, (-0.4, 0.3, 0.5), 0.25, 0.05)}, written("propellant_slosh", SLOSH), 1e-4),
    # the plant's sign has corners, the law's is rounded: both over 1 mrad/s
    "wheel": ({"wheel": Wheel(2, 0.1, 2e-3, 0.01, 0.2)}, written("wheel_friction", WHEEL), 3e-3),
}


@pytest.mark.parametrize("name", CASES)
def test_base_goes_where_drakes_goes(tmp_path, name):
    inside, text, tolerance = CASES[name]
    path = record(tmp_path / "motion.csv", 1, noise=0.0, **inside)
    found = simulate(model(tmp_path, text), path)
    truth = read_recording(path).sel(time=found.time, method="nearest")
    for kind, axes in (("pos.hub", "xyz"), ("vel.hub", "xyz"), ("omega.hub", "xyz"), ("quat.hub", "wxyz")):
        true = stack(truth, kind, axes)
        size = np.max(np.linalg.norm(true - true[0], axis=1))
        np.testing.assert_allclose(stack(found, kind, axes), true, rtol=0, atol=tolerance * size)
    for joint in ("shoulder", "elbow"):  # our torque is smooth within the band
        np.testing.assert_allclose(found[f"tau.{joint}"], truth[f"tau.{joint}"], atol=2e-2)


@pytest.mark.slow
@pytest.mark.usefixtures("compiler")
def test_what_is_written_reads_back(tmp_path, capsys):
    motion, out = record(tmp_path / "motion.csv", 1), tmp_path / "out.csv"
    model(tmp_path, written("propellant_slosh", SLOSH))
    given = ["simulate", tmp_path / "servicer.toml", "--motion", motion, "--out", out]
    assert main([str(x) for x in given]) == 0
    assert main(["identify", str(tmp_path / "servicer.toml"), str(out), "--json", "-"]) == 0
    told = json.loads(capsys.readouterr().out)
    for p in told["parameters"]:
        assert p["value"] == pytest.approx(SLOSH[p["name"]], rel=2e-2)
    assert all(fit["train"]["relative"] < 5e-3 for fit in told["fit"].values())


def test_without_a_recorded_base_there_is_no_momentum(tmp_path):
    """ETS-VII, from joints alone; momentum by functions that the simulation does not use."""
    time = np.arange(0.0, 20.0, 0.02)
    waves = {f"joint{k}": 0.3 * np.sin(0.2 * k * time + k) for k in range(1, 7)}
    columns = {f"q.{j}": ("time", q) for j, q in waves.items()}  # no torque
    write_recording(xr.Dataset(columns, coords={"time": time}), tmp_path / "motion.csv")
    (tmp_path / "ets.toml").write_text('system = "free_floating_arm"\n')
    found = simulate(load_model(tmp_path / "ets.toml"), tmp_path / "motion.csv")
    assert np.ptp(stack(found, "quat.base", "wxyz"), axis=0).max() > 1e-3
    q, qd = (np.stack([found[f"{kind}.{j}"].values for j in waves], 1) for kind in ("q", "qd"))
    back = read_back(found)
    momentum = world_momentum(ets_vii(), stack(found, "pos.base"), stack(found, "quat.base", "wxyz"), q, back, qd)
    size = 2552.0 * np.linalg.norm(back[:, :3], axis=1).max(), 3541.0 * np.linalg.norm(back[:, 3:], axis=1).max()
    assert np.abs(momentum[:, :3]).max() < 1e-9 * size[0]
    assert np.abs(momentum[:, 3:]).max() < 1e-9 * size[1]


def read_back(found):
    """The base's twist in its own axes, which the recording has in the world's."""
    back = Rotation.from_quat(stack(found, "quat.base", "wxyz"), scalar_first=True).inv()
    return np.hstack([back.apply(stack(found, "vel.base")), back.apply(stack(found, "omega.base"))])


def test_free_inertia_is_identified_whatever_the_file_says(tmp_path):
    """Total mass and base parameters to 0.2 %; the sums are those that a URDF with other masses would not give."""
    path = record(tmp_path / "1.csv", 1)
    model(tmp_path, 'inertia = "free"')
    urdf = (tmp_path / "servicer.urdf").read_text()
    for right, wrong in (('mass value="400"', 'mass value="300"'), ('mass value="15"', 'mass value="25"')):
        urdf = urdf.replace(right, wrong)
    (tmp_path / "servicer.urdf").write_text(urdf)
    found = identify(load_model(tmp_path / "servicer.toml"), [path]).to_json()
    got = {(p["at"], p["name"]): p["value"] for p in found["parameters"]}
    # 400 + 20 + 15 kg; hub's own first moment and what hangs at (0.6, 0.2, 0.1)
    true = {"mass": 435.0, "mx": 400 * 0.1 + 35 * 0.6, "my": 35 * 0.2, "mz": 400 * 0.05 + 35 * 0.1}
    for name, value in true.items():
        assert got["base", name] == pytest.approx(value, rel=2e-3)
    assert got["upper", "mx"] == pytest.approx(20 * 0.6 + 15 * 1.2, rel=2e-3)
    assert found["inertia"]["physical"]


def test_bad_input(tmp_path):
    path = record(tmp_path / "1.csv", 1)
    with pytest.raises(InputError, match=r"no value for 'propellant_slosh.base.mass_x'"):
        simulate(model(tmp_path, 'effects = ["propellant_slosh"]'), path)
    text = 'effects = [{ name = "joint_elasticity", at = "elbow" }]\n[parameters]\n'
    text += "\n".join(f'"joint_elasticity.elbow.{name}" = 1e4' for name in ("stiffness", "damping"))
    with pytest.raises(InputError, match="joint_elasticity at elbow moves the arm behind its encoder"):
        simulate(model(tmp_path, text), path)
    table = read_recording(path)
    table["q.elbow"][1500:1510] = np.nan
    write_recording(table, tmp_path / "gap.csv")
    with pytest.raises(InputError, match="has 1 gaps, across which nobody knows where the base floats"):
        simulate(model(tmp_path), tmp_path / "gap.csv")
