"""FMUs in the tools that accept them: the same numbers as the model run natively, and exact rollback in a C program.

One FMU of each kind; with SNARELAB_ALL_FMUS=1 in the environment all that come with the package.
"""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bench.fmu_models import Slave, everywhere, rewritten, tool_environment, write_model
from snarelab.fmi.archive import open_fmu
from snarelab.fmu.build import write_fmu
from snarelab.fmu.elements import ELEMENTS
from snarelab.fmu.export import export, model_equations
from snarelab.fmu.hosted import participant_class
from snarelab.fmu.inverse import inverse_equations
from snarelab.models.c_library import find_compiler
from snarelab.models.model_file import load_model

SIZE, STEPS = 2.0**-9, 60  # exact in binary, and in libcosim's nanoseconds: every tool takes the same steps
STARTS = {
    "arm": {"start.q.joint1": 0.3, "start.qd.joint2": -0.4, "tau.joint1": 8.0, "tau.joint3": -1.0},
    "arm_inverse": {"q.joint1": 0.4, "qd.joint2": 0.3, "qdd.joint3": -2.0, "qd.joint1": 1e-4},
    "joint_friction": {"qd.joint": 0.4, "stribeck_friction.joint.level": 0.7},
    "suspended_target": {"force.target.y": 12.0, "force.target.x": 3.0, "drag": 2.0},
    "left_oscillator": {"force": 3.0, "damping": 0.5},
}
HOSTED = {"left_oscillator", "right_oscillator", "snare", "impulse_snare", "held_snare"}
if os.environ.get("SNARELAB_ALL_FMUS"):
    STARTS |= {
        "ets_vii_arm": {"tau.joint2": 0.8, "start.omega.base.z": 0.01, "force.tip.x": 2.0},
        "space_arm": {"tau.joint3": 40.0, "force.tip.z": 5.0, "solver.tolerance": 1e-11},
        "right_oscillator": {"x_left": 0.5, "coupling_damping": 0.3},
        **{name: {"vel.effector.x": 0.02} for name in ("snare", "impulse_snare", "held_snare")},
    }
KINDS = [(name, version) for name in STARTS for version in (2, 3)]


class Shipped:
    """FMUs of every kind, their equations, and where they are unpacked."""

    def __init__(self, folder):
        self.folder = folder
        values = everywhere("viscous_friction", "coefficient", [3.0, 2.0, 1.0])
        values |= everywhere("coulomb_friction", "level", [1.0, 0.5, 0.2]) | {
            f"speed_scale.joint{k}": 900.0 for k in (1, 2, 3)
        }
        model = load_model(write_model(folder, "arm", 3, '["viscous_friction", "coulomb_friction"]', values))
        self.equations = {"arm": model_equations(model), "arm_inverse": inverse_equations(model)}
        self.equations |= {name: ELEMENTS[name]() for name in ELEMENTS if name in STARTS}

    def path(self, name, version):
        path = self.folder / f"{name}{version}.fmu"
        if not path.is_file():
            if name in self.equations:
                write_fmu(self.equations[name], path, version)
            else:
                export(name, version, path)
        return path

    def unpacked(self, name, version):
        folder = self.folder / f"{name}{version}"
        if not folder.is_dir():
            open_fmu(self.path(name, version), folder)
        return folder

    def native(self, name):
        """Output names, and their values after STEPS steps of the same model run from here."""
        start = STARTS[name]
        if name in HOSTED:
            p = participant_class(name)()
            p.initialize(0.0, {k: v for k, v in start.items() if k in p.names("parameter")})
            inputs = np.array([start.get(v.name, v.start) for v in p.variables if v.causality == "input"])
            for k in range(STEPS):
                p.set_inputs(inputs)
                p.step(k * SIZE, SIZE)
            return list(p.names("output")), p.outputs()
        e = self.equations[name]
        u, p = (np.array([start.get(v.name, v.start) for v in e.of(c)]) for c in ("input", "parameter"))
        x, f = np.array(e.functions["initial"](0, u, p)).ravel(), e.functions.get("rate")
        if e.stiff:
            assert f is not None
            run = solve_ivp(
                lambda t, x: np.array(f(t, x, u, p)).ravel(), (0, STEPS * SIZE), x, "DOP853", rtol=1e-11, atol=1e-12
            )
            found = e.functions["output"](STEPS * SIZE, run.y[:, -1], u, p)
            return [v.name for v in e.of("output")], np.array(found).ravel()
        h = SIZE / 2  # two internal steps of at most 1 ms
        for k in range(2 * STEPS if e.n_states and f is not None else 0):

            def rate(x, f=f, k=k, u=u, p=p):
                assert f is not None
                return np.array(f(k * h, x, u, p)).ravel()

            k1 = rate(x)
            k2 = rate(x + h / 2 * k1)
            k3 = rate(x + h / 2 * k2)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + h * k3))
        return [v.name for v in e.of("output")], np.array(e.functions["output"](STEPS * SIZE, x, u, p)).ravel()


@pytest.fixture(scope="module")
def shipped(tmp_path_factory):
    return Shipped(tmp_path_factory.mktemp("fmus"))


@pytest.mark.parametrize(("name", "version"), KINDS)
def test_fmpy_finds_no_problem(shipped, name, version):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(shipped.path(name, version))) == []


@pytest.mark.parametrize("tool", ["fmpy", "ecospy", "libcosimpy"])
@pytest.mark.parametrize(("name", "version"), KINDS)
def test_other_tools_give_the_native_numbers(shipped, tool, name, version):
    if tool == "libcosimpy" and version == 3:
        pytest.skip("libcosim reads FMI 2.0 only")
    if importlib.util.find_spec(tool) is None:
        pytest.skip(f"{tool} is not installed")
    names, wanted = shipped.native(name)
    given = {"start": STARTS[name], "outputs": names}
    environment = tool_environment()
    command = [
        sys.executable,
        str(Path(__file__).parents[1] / "helpers" / "fmu_tools.py"),
        tool,
        str(shipped.path(name, version)),
    ]
    run = subprocess.run(
        [*command, str(SIZE), str(STEPS), json.dumps(given)], capture_output=True, text=True, env=environment
    )
    if run.returncode and "libtbb" in run.stderr:
        pytest.skip("ecospy finds no oneTBB: pip install tbb")
    assert run.returncode == 0, run.stdout + run.stderr
    found = np.array([float.fromhex(x) for x in run.stdout.split()[-len(names) :]])
    if name in HOSTED:
        assert found.tobytes() == np.asarray(wanted).tobytes()
    else:
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)


@pytest.fixture(scope="module")
def hosts(tmp_path_factory):
    """The C program, for each version of FMI."""
    import fmpy

    folder, headers = tmp_path_factory.mktemp("host"), Path(fmpy.__file__).parent / "c-code"
    for version in (2, 3):
        source = str(Path(__file__).parents[1] / "helpers" / "fmu_host.c")
        compiler, _ = find_compiler("", os.environ["PATH"])
        command = [*compiler, "-g", "-O1", f"-DFMI={version}", f"-I{headers}", source]
        subprocess.run([*command, "-o", str(folder / f"host{version}"), "-ldl"], check=True)
    return folder


def host_command(shipped, hosts, name, version):
    folder = shipped.unpacked(name, version)
    archive_folder = next((folder / "binaries").iterdir())
    text = (folder / "modelDescription.xml").read_text()
    token = text[text.index('="{') + 2 : text.index('}"') + 1]
    slave_names = variable_references(folder)
    outputs = [r for r, causality in slave_names.values() if causality == "output"]
    starts = [f"{slave_names[k][0]}={v!r}" for k, v in STARTS[name].items()]
    library = str(next(archive_folder.iterdir()))
    shape = [str(len(outputs)), str(min(outputs)), str(STEPS), str(SIZE)]
    return [str(hosts / f"host{version}"), library, token, str(folder / "resources"), *shape, *starts]


def variable_references(folder):
    from fmpy import read_model_description

    described = read_model_description(str(folder), validate=False)
    return {v.name: (v.valueReference, v.causality) for v in described.modelVariables}


@pytest.mark.parametrize(("name", "version"), KINDS)
def test_a_c_program_without_environment_rolls_back_exactly(shipped, hosts, name, version):
    names, wanted = shipped.native(name)
    run = subprocess.run(host_command(shipped, hosts, name, version), capture_output=True, text=True, env={})
    assert run.returncode == 0, run.stderr
    found = np.array([float.fromhex(x) for x in run.stdout.split()])
    assert len(found) == len(names)
    if name in HOSTED:
        assert found.tobytes() == np.asarray(wanted).tobytes()
    else:
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)
    assert "are not of one export" in run.stderr  # a foreign token was refused, and said so


@pytest.mark.parametrize(("name", "version"), [("arm", 2), ("arm", 3), ("arm_inverse", 3), ("left_oscillator", 2)])
def test_no_memory_is_lost_or_misread(shipped, hosts, name, version):
    if shutil.which("valgrind") is None:
        pytest.skip("valgrind is not installed")
    command = [
        "valgrind",
        "-q",
        "--leak-check=full",
        "--show-leak-kinds=all",
        "--error-exitcode=9",
        "--trace-children=no",
    ]
    run = subprocess.run(
        [*command, *host_command(shipped, hosts, name, version)],
        capture_output=True,
        text=True,
        env={"PATH": os.defpath},
    )
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("name", ["arm", "left_oscillator"])
@pytest.mark.parametrize("version", [2, 3])
def test_rollback_inside_fmpy(shipped, name, version):
    """Save, 50 steps, restore, 50 steps; in a second instance; after serialising: the same bits."""
    folder = shipped.unpacked(name, version)
    one, two = (Slave(None, folder, STARTS[name]) for _ in range(2))
    one.step(0.02)
    state = one.save()
    data = one.fmu.serializeFMUState(state[0]) if version == 3 else one.fmu.serializeFMUstate(state[0])

    def run(slave):
        for k in range(50):
            slave.set({"tau.joint2" if name == "arm" else "force": np.sin(k)})
            slave.step(SIZE)
        return slave.get().tobytes()

    wanted = run(one)
    one.restore(state)
    assert run(one) == wanted
    two.restore(state)
    assert run(two) == wanted
    two.restore(((two.fmu.deserializeFMUState if version == 3 else two.fmu.deSerializeFMUstate)(data), state[1]))
    assert run(two) == wanted
    for s in (one, two):
        s.close()


def test_it_rebuilds_from_its_sources(shipped, tmp_path):
    """``fmpy compile`` on an archive without binaries; the rebuilt one gives the same numbers."""
    if shutil.which("cmake") is None:
        pytest.skip("cmake is not installed")
    bare = rewritten(
        shipped.path("arm", 3), tmp_path / "arm.fmu", lambda n, d: None if n.startswith("binaries/") else d
    )
    run = subprocess.run([sys.executable, "-m", "fmpy", "compile", str(bare)], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    names, wanted = shipped.native("arm")
    s = Slave(bare, tmp_path / "arm", STARTS["arm"])
    for _ in range(STEPS):
        s.step(SIZE)
    np.testing.assert_allclose(s.get(names), wanted, rtol=1e-9, atol=1e-9)
    s.close()


def test_the_description_is_one_a_stranger_can_use(shipped):
    """Every variable says what it is; SI units, display units and bounds where they belong."""
    from fmpy import read_model_description

    for name in STARTS:
        described = read_model_description(str(shipped.unpacked(name, 3)))
        plain = {v.name for v in shipped.equations[name].variables if v.unit == "1"} if name not in HOSTED else set()
        for v in described.modelVariables:
            assert v.description, v.name
            assert v.unit or name in HOSTED or v.name in plain, v.name
        files = {
            str(f.relative_to(shipped.unpacked(name, 3))) for f in shipped.unpacked(name, 3).rglob("*") if f.is_file()
        }
        assert {"documentation/index.html", "documentation/licenses/license.txt", "terminalsAndIcons/icon.png"} <= files
    described = read_model_description(str(shipped.unpacked("arm", 3)))
    by_name: dict[str, Any] = {v.name: v for v in described.modelVariables}
    assert by_name["q.joint1"].unit == "rad"
    assert by_name["q.joint1"].displayUnit == "deg"
    assert by_name["coulomb_friction.joint1.level"].unit == "N.m"
    assert float(by_name["coulomb_friction.joint1.level"].min) == 0.0
    assert float(by_name["coulomb_friction.joint2.level"].start) == 0.5
