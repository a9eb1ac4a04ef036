"""The Exudyn snare as an FMU: the native numbers, exact rollback, and a run beside a C arm in another tool."""

import importlib.util
from typing import Any

import numpy as np
import pytest
from ecos import by_hand, in_ecos
from scipy.spatial.transform import Rotation

from bench.fmu_models import Slave, everywhere, write_model
from snarelab.cosim.participants.fmu import Fmu
from snarelab.cosim.participants.snare import SnareParticipant
from snarelab.cosim.setup import Setup
from snarelab.cosim.ssp_write import write_ssp
from snarelab.cosim.system import System
from snarelab.fmu.build import write_fmu
from snarelab.fmu.export import export, model_equations
from snarelab.fmu.hosted import participant_class
from snarelab.models.model_file import load_model
from snarelab.recordings.signals import pose_names

SIZE, STEPS = 2.0**-8, 16
POSE = [name.replace(".tip", "") for name in pose_names("tip")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The snare, and an arm of two joints that carries it."""
    if importlib.util.find_spec("exudyn") is None:
        pytest.skip("exudyn is not installed")
    place = tmp_path_factory.mktemp("snare")
    export("snare", 2, place / "snare.fmu")
    # Heavy motors: what a snare's contact does to a light arm needs smaller steps than Ecos's one.
    values = everywhere("viscous_friction", "coefficient", [50.0, 50.0])
    values |= everywhere("rotor_inertia", "inertia", [200.0, 200.0])
    model = write_model(place, "arm", 2, '["viscous_friction", "rotor_inertia"]', values, gravity=(0, 0, 0))
    write_fmu(model_equations(load_model(model), stiff=False), place / "arm.fmu", 2)
    return place


@pytest.mark.parametrize(("name", "version"), [("snare", 2), ("held_snare", 3)])
def test_native_numbers_and_exact_rollback(folder, name, version):
    path = folder / f"{name}.fmu"
    if not path.is_file():
        export(name, version, path)
    s, p = Slave(path, folder / name), participant_class(name)()
    p.initialize()
    inputs = [v for v in p.variables if v.causality == "input"]
    values = np.array([v.start for v in inputs])
    names, w = [v.name for v in inputs], 2.0
    for k in range(12):
        moved = {"pos.effector.x": 1e-3 * (1 - np.cos(w * k * SIZE)), "vel.effector.x": 1e-3 * w * np.sin(w * k * SIZE)}
        for name, value in moved.items():
            values[names.index(name)] = value
        s.set(moved)
        s.step(SIZE)
        p.set_inputs(values)
        p.step(k * SIZE, SIZE)
    assert np.abs(p.outputs()[0]) > 1e-4
    assert s.get(p.names("output")).tobytes() == p.outputs().tobytes()
    state = s.save()
    wanted = None
    for _ in range(2):
        s.restore(state)
        for _ in range(10):
            s.step(SIZE)
        wanted = s.get().tobytes() if wanted is None else wanted
        assert s.get().tobytes() == wanted
    s.close()


def test_a_capture_from_its_model_file(folder, tmp_path):
    """Effects under the vocabulary's names, the file's values at the start; the numbers are those of its set-up."""
    lines = ['name = "test 1"', 'system = "snare_capture"', 'effects = ["contact_friction", "umbilical_stiffness"]']
    lines += ["[capture]", "ring_rate = 0.7", "[parameters]", '"contact_friction.pin.coefficient" = 0.2']
    (tmp_path / "c.toml").write_text("\n".join([*lines, '"umbilical_stiffness.target.stiffness" = 30.0']) + "\n")
    export(str(tmp_path / "c.toml"), 3, tmp_path / "c.fmu")
    tree: Any = load_model(tmp_path / "c.toml").tree
    values = {"contact_friction.pin.coefficient": 0.3, "umbilical_stiffness.target.stiffness": 20.0}
    setup = tree.setup.with_values(values)
    s, p = Slave(tmp_path / "c.fmu", tmp_path / "c", values), SnareParticipant(setup.parameters, setup.target)
    p.initialize()
    for k in range(12):
        s.step(SIZE)
        p.step(k * SIZE, SIZE)
    assert s.get(p.names("output")).tobytes() == p.outputs().tobytes()
    s.close()


def test_arm_and_snare_together_in_ecos_from_our_ssp_file(folder, tmp_path):
    """Ecos holds inputs over a step and moves all at once: the same loop by hand gives the same numbers."""
    pytest.importorskip("libcosimpy")
    arm, snare = Fmu(folder / "arm.fmu", "arm"), Fmu(folder / "snare.fmu", "snare")
    wires = [(f"arm.{stem}.tip.{axis}", f"snare.{stem}.effector.{axis}") for stem, axis in (n.split(".") for n in POSE)]
    wires += [(f"snare.{kind}.effector.{a}", f"arm.{kind}.tip.{a}") for kind in ("force", "torque") for a in "xyz"]
    given = {f"arm.{v.name}": v.start for v in arm.variables if v.name.startswith("tau.")}
    given |= {f"snare.{v.name}": v.start for v in snare.variables if v.causality == "input" and ".pin." in v.name}
    given |= {"arm.tau.joint1": 5.0, "arm.tau.joint2": -2.0}
    # The snare starts where the arm holds it.
    first = Slave(folder / "arm.fmu", folder / "arm")
    tip = dict(zip(POSE, first.get([n.replace(".", ".tip.") for n in POSE]), strict=True))
    first.close()
    given |= {f"snare.{name}": value for name, value in pin_before(tip, given).items()}
    system = System({"arm": arm, "snare": snare}, wires, parameters=given, name="capture")
    write_ssp(Setup(system, step=SIZE, stop=SIZE * STEPS), tmp_path / "capture.ssp")

    slaves = {
        "arm": Slave(folder / "arm.fmu", folder / "arm"),
        "snare": Slave(folder / "snare.fmu", folder / "snare", tip_start(tip)),
    }
    for name, value in given.items():
        who, _, variable = name.partition(".")
        slaves[who].set({variable: value})
    shown = ["arm::q.joint1", "arm::qd.joint2", "snare::force.effector.x", "snare::torque.effector.y"]
    wanted = by_hand(slaves, wires, SIZE, STEPS, shown)
    found = in_ecos(tmp_path / "capture.ssp", SIZE, STEPS, shown)
    assert abs(wanted[2]) > 1e-6
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)


def pin_before(tip, given):
    """Pose of the pin where the snare, held by the arm, has it before itself as at its own start."""
    turn = Rotation.from_quat([tip[f"quat.{a}"] for a in "xyzw"])
    place = turn.apply([given[f"snare.pos.pin.{a}"] for a in "xyz"]) + [tip[f"pos.{a}"] for a in "xyz"]
    attitude = (turn * Rotation.from_quat([given[f"snare.quat.pin.{a}"] for a in "xyzw"])).as_quat()
    found = {f"pos.pin.{a}": float(x) for a, x in zip("xyz", place, strict=True)}
    return found | {f"quat.pin.{a}": float(x) for a, x in zip("xyzw", attitude, strict=True)}


def tip_start(tip):
    """Start values of the snare's inputs."""
    return {f"{stem}.effector.{axis}": tip[f"{stem}.{axis}"] for stem, axis in (n.split(".") for n in POSE)}
