"""FMUs with a Python process beside them: errors reach the importer, models stay apart, rollback is exact."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bench.fmu_models import Slave, rewritten
from snarelab.cosim.participants.oscillator import LeftOscillator, RightOscillator
from snarelab.fmu.hosted import participant_names, write_hosted, write_hosted_class

MODULE = """
from {helper} import FACTOR
import os
import numpy as np
from snarelab.cosim.participant import Participant, StepError, Variable

class Model(Participant):
    name = "model"
    can_restore = True
    variables = (
        Variable("u", "input", "1"), Variable("wish", "input", "1"), Variable("y", "output", "1", depends=("u",))
    )

    def __init__(self, gain=1.0):
        self.gain = gain

    def initialize(self, time=0.0, parameters=None):
        self.total, self.u, self.wish = 0.0, 0.0, 0

    def set_inputs(self, values):
        self.u, self.wish = float(values[0]), int(values[1])

    def step(self, time, size):
        print("models print what they like")
        if self.wish == 1:
            raise StepError(f"{{self.name}}: at {{time:g}} s it will not, 100 %")
        if self.wish == 2:
            raise ValueError("something broke")
        if self.wish == 3:
            os._exit(7)
        if self.wish == 4:
            raise SystemExit("out")
        self.total += FACTOR * self.gain * self.u * size

    def outputs(self):
        return np.array([self.total + 1e-3 * self.u])

    def save(self):
        return self.total

    def restore(self, state):
        self.total = state
"""


@pytest.fixture
def make(tmp_path, monkeypatch):
    """Write a module and its same-named helper in a folder of its own, and export the module's model."""

    def made(name, factor, version=2, **arguments):
        folder = tmp_path / f"src_{name}"
        folder.mkdir()
        (folder / "helper.py").write_text(f"FACTOR = {factor}\n")
        (folder / f"module_{name}.py").write_text(MODULE.format(helper="helper"))
        monkeypatch.syspath_prepend(str(folder))
        sys.modules.pop("helper", None)
        cls = __import__(f"module_{name}").Model
        return write_hosted_class(cls, arguments, tmp_path / f"{name}.fmu", version, name)

    return made


def test_participants_are_found_by_name():
    assert {"left_oscillator", "right_oscillator"} <= set(participant_names())


@pytest.mark.parametrize("version", [2, 3])
def test_two_models_share_no_module(make, tmp_path, version):
    """Both import a helper of the same name, with another number in each."""
    paths = [make(name, factor, version) for name, factor in (("one", 2.0), ("two", 5.0))]
    slaves = [Slave(p, tmp_path / f"x{k}", {"u": 1.0, "wish": 0.0}) for k, p in enumerate([*paths, paths[0]])]
    slaves[2].set({"u": 3.0})
    for s in slaves:
        s.step(0.5)
    assert [s.get()[0] - 1e-3 * u for s, u in zip(slaves, (1, 1, 3), strict=True)] == pytest.approx([1.0, 2.5, 3.0])
    state = slaves[0].save()
    slaves[0].step(0.5)
    wanted = slaves[0].get().tobytes()
    slaves[0].restore(state)
    slaves[0].step(0.5)
    assert slaves[0].get().tobytes() == wanted
    slaves[2].restore(state)
    slaves[2].step(0.5)
    assert slaves[2].get().tobytes() == wanted  # inputs are part of a state
    slaves[2].set({"u": 0.0})
    assert slaves[2].get()[0] == pytest.approx(2.0)  # an input that acts at once, acts at once
    for s in slaves:
        s.close()


@pytest.mark.parametrize(
    ("version", "wish", "words"),
    [
        (2, 1, "it will not, 100 %"),
        (2, 2, "ValueError: something broke"),
        (2, 3, "it ended with status 7"),
        (2, 4, "SystemExit: out"),
        (3, 2, "ValueError: something broke"),
        (3, 3, "it ended with status 7"),
    ],
)
def test_what_fails_in_the_model_is_a_status_and_a_line(make, tmp_path, version, wish, words):
    logged = []
    s = Slave(make("m", 1.0, version), tmp_path / "x", {"u": 1.0, "wish": 0.0}, logged=logged)
    s.step(0.1)
    state = s.save()
    s.set({"wish": wish})
    with pytest.raises(Exception, match=r"(?i)discard|error|status"):
        s.step(0.1)
    assert any(words in line.replace("%%", "%") for line in logged), logged
    if wish != 3:  # the process lives, and goes on from the saved state
        s.restore(state)
        s.step(0.1)
        assert s.get()[0] == pytest.approx(0.2 + 1e-3)
    s.fmu.freeInstance()


def changed(source, target, **entries):
    """A hosted FMU with other entries in host.json."""

    def change(name, data):
        return json.dumps(json.loads(data) | entries).encode() if name == "resources/host.json" else data

    return rewritten(source, target, change)


@pytest.mark.parametrize(
    ("version", "entries", "words"),
    [
        (2, {"module": "no_such_package.model"}, "ModuleNotFoundError"),
        (3, {"module": "no_such_package.model"}, "ModuleNotFoundError"),
        (2, {"class": "Nobody"}, "AttributeError"),
        (2, {"output": ["y", "z"]}, "export it again"),
        (2, {"arguments": {"gain": 1.0, "nonsense": 2.0}}, "TypeError"),
        (2, {"token": "{another}"}, "has the token"),
    ],
)
def test_what_is_missing_is_told_at_instantiation(make, tmp_path, version, entries, words):
    path, logged = changed(make("m", 1.0, version), tmp_path / "bad.fmu", **entries), []
    with pytest.raises(Exception, match="Failed to instantiate"):
        Slave(path, tmp_path / "x", logged=logged)
    assert any(words in line for line in logged), logged


@pytest.mark.parametrize(
    ("python", "words"), [("/no/such/python", "cannot be started"), ("/bin/false", "it ended with status 1")]
)
def test_a_wrong_interpreter_is_told(make, tmp_path, python, words):
    def change(name, data):
        return python.encode() if name == "resources/python.txt" else data

    path, logged = rewritten(make("m", 1.0), tmp_path / "bad.fmu", change), []
    with pytest.raises(Exception, match="Failed to instantiate"):
        Slave(path, tmp_path / "x", logged=logged)
    assert any(words in line for line in logged), logged


def test_an_interpreter_without_the_package_is_told(tmp_path):
    """The system's own Python, without numpy or snarelab to be seen."""
    bare = shutil.which("python3", path="/usr/bin")
    if bare is None or subprocess.run([bare, "-c", "import numpy"], capture_output=True, env={}).returncode == 0:
        pytest.skip("no interpreter without numpy here")
    write_hosted("left_oscillator", tmp_path / "x.fmu", 2)

    def change(name, data):
        if name == "resources/host.json":  # the folders of this test's own packages would serve it
            return json.dumps({**json.loads(data), "path": []}).encode()
        return f"{bare}\n".encode() if name == "resources/python.txt" else data

    path, logged = rewritten(tmp_path / "x.fmu", tmp_path / "bad.fmu", change), []
    with pytest.raises(Exception, match="Failed to instantiate"):
        Slave(path, tmp_path / "x", logged=logged)
    assert any("Error" in line and bare in line for line in logged), logged


@pytest.mark.parametrize("version", [2, 3])
def test_a_coupled_pair_is_bitwise_the_native_one(tmp_path, version):
    left, right = LeftOscillator(), RightOscillator()
    left.initialize(0.0)
    right.initialize(0.0, {"coupling_damping": 0.3})
    slaves = []
    for name in ("left_oscillator", "right_oscillator"):
        write_hosted(name, tmp_path / f"{name}.fmu", version)
        start = {"coupling_damping": 0.3} if name.startswith("right") else {}
        slaves.append(Slave(tmp_path / f"{name}.fmu", tmp_path / name, start))
    force, size = 0.0, 2.0**-7
    for k in range(40):
        motion = left.outputs()
        left.set_inputs(np.array([force]))
        right.set_inputs(motion)
        slaves[0].set({"force": force})
        slaves[1].set(dict(zip(("x_left", "v_left"), slaves[0].get(), strict=True)))
        for p in (left, right):
            p.step(k * size, size)
        for s in slaves:
            s.step(size)
        force = right.outputs()[2]
        assert slaves[0].get().tobytes() == left.outputs().tobytes()
        assert slaves[1].get().tobytes() == right.outputs().tobytes()
    for s in slaves:
        s.close()


def test_freeing_ends_the_process(make, tmp_path):
    s = Slave(make("m", 1.0), tmp_path / "x", {"u": 1.0, "wish": 0.0})
    children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children")
    if not children.exists():
        pytest.skip("the system does not list children")
    before = set(children.read_text().split())
    s.close()
    assert len(before - set(children.read_text().split())) == 1


def test_input_derivatives_reach_the_model(tmp_path):
    """FMI 2.0's slopes are the participant's own; after the step the input stands at the slope's end."""
    write_hosted("left_oscillator", tmp_path / "x.fmu", 2)
    s, p = Slave(tmp_path / "x.fmu", tmp_path / "x"), LeftOscillator()
    p.initialize()
    for k in range(5):
        s.set({"force": 1.0 + k})
        s.fmu.setRealInputDerivatives([s.references["force"]], [1], [0.5])
        s.step(0.25)
        p.set_inputs(np.array([1.0 + k]))
        p.set_input_derivatives(np.array([0.5]), np.zeros(1))
        p.step(0.25 * k, 0.25)
        assert s.get(["force"])[0] == 1.0 + k + 0.125
    assert s.get().tobytes() == p.outputs().tobytes()
    s.close()
