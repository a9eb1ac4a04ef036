"""System files of participants in Python: what each key becomes, and what is said of a mistake."""

import re
import sys

import pytest

from snarelab.cosim.iteration import Iteration
from snarelab.cosim.participants.oscillator import LeftOscillator
from snarelab.cosim.setup import Hosting
from snarelab.cosim.step_control import StepControl
from snarelab.cosim.toml_system import read_toml
from snarelab.errors import InputError

HERE = Hosting(own_process=False)
WHERE = "snarelab.cosim.participants.oscillator"
HALVES = f"""
[participants.left]
python = "{WHERE}:LeftOscillator"
options = {{ name = "near", substeps = 4 }}
parameters = {{ mass = 2, stiffness = 7.5 }}

[participants.right]
python = "{WHERE}:RightOscillator"

[connections]
"left.force" = {{ source = "right.force", factor = -2, offset = 0.5 }}
"right.x_left" = "left.x"
"right.v_left" = "left.v"
"""


def read(folder, text, name="two.toml"):
    path = folder / name
    path.write_text(text)
    return read_toml(path, HERE)


def test_keys_become_what_a_run_is_given(tmp_path):
    """Whole numbers do for numbers; what is left out stays as it usually is."""
    text = """
step = 1
start = 2
stop = 0.5
scheme = "gauss_seidel"
hold = "linear"
name = "chain"
iterate = { tolerance = 1e-6, limit = 9, kept = 0 }
control = { tolerance = 1e-4, smallest = 1e-5, largest = 1, magnitudes = { "left.x" = 2.0 } }
"""
    setup = read(tmp_path, text + HALVES + '[bonds.spring]\neffort = "right.force"\nflow = "left.v"\n')
    assert (setup.step, setup.start, setup.stop) == (1.0, 2.0, 0.5)
    assert isinstance(setup.step, float)
    assert (setup.scheme, setup.hold, setup.system.name) == ("gauss_seidel", "linear", "chain")
    assert setup.iterate == Iteration(1e-6, 9, 0)
    assert setup.control == StepControl(1e-4, {"left.x": 2.0}, 1e-5, 1.0)
    assert setup.system.parameters_of("left") == {"mass": 2.0, "stiffness": 7.5}
    left = setup.system.participants["left"]
    assert isinstance(left, LeftOscillator)
    assert (left.name, left._substeps) == ("near", 4)
    (back,) = (c for c in setup.system.connections if c.target == "left.force")
    assert (back.source, back.factor, back.offset) == ("right.force", -2.0, 0.5)
    (plain,) = (c for c in setup.system.connections if c.target == "right.v_left")
    assert (plain.source, plain.factor, plain.offset) == ("left.v", 1.0, 0.0)
    (bond,) = setup.system.bonds
    assert (bond.name, bond.effort, bond.flow) == ("spring", "right.force", "left.v")


@pytest.mark.parametrize(("given", "becomes"), [("", False), ("iterate = true\n", True), ("iterate = false\n", False)])
def test_a_system_goes_by_its_file_and_iterates_where_it_is_told_to(tmp_path, given, becomes):
    setup = read(tmp_path, given + HALVES)
    assert (setup.system.name, setup.iterate, setup.control) == ("two", becomes, None)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("", "step = true\n", "step: True is not a number"),
        ("", "hold = 2\n", "hold: 2 is not text"),
        ("", "control = { limit = 3 }\n", "control: 'limit' is unknown; nearest is "),
        ("", "control = { magnitudes = 1 }\n", "control.magnitudes: 1 is not a table"),
        ("", "iterate = { limit = 3.5 }\n", "iterate.limit: 3.5 is not a whole number"),
        ("", "iterate = { kept = true }\n", "iterate.kept: True is not a whole number"),
        ("", "iterate = { tolerance = 'low' }\n", "iterate.tolerance: 'low' is not a number"),
        ("mass = 2", "mass = 'two'", "participants.left.mass: 'two' is not a number"),
        (
            "parameters = { mass = 2, stiffness = 7.5 }",
            "parameters = 2",
            "participants.left.parameters: 2 is not a table",
        ),
        ("substeps = 4", "substep = 4", "participants.left.options: .*unexpected keyword argument 'substep'"),
        ("options = {", "option = {", "participants.left: 'option' is unknown; nearest is 'options'"),
        ("options = {", "own_process = 1\noptions = {", "participants.left.own_process: 1 is not true or false"),
        ("options = {", "timeout = 'long'\noptions = {", "participants.left.timeout: 'long' is not a number"),
        ("options = {", "fmu = 'a.fmu'\noptions = {", "participants.left: give either fmu = a file or python"),
        (f'"{WHERE}:LeftOscillator"', "3", "participants.left.python: 3 is not text"),
        ("LeftOscillator", "_parameters", "is no participant; it must derive from"),
        ("LeftOscillator", "Missing", "cannot be imported"),
        ('source = "right.force", ', "", r"connections.'left.force': has no source; add it"),
        ('"left.x"', "4", r"connections.'right.x_left': 4 is not a table"),
        ("[connections]", '[bonds.b]\nflow = "left.v"\n[connections]', "bonds.b: has no effort; add it"),
        ("[connections]", "[bonds.b]\n[connections]", "bonds.b: has no effort; add it"),
    ],
)
def test_a_mistake_is_told_with_the_file_and_the_key(tmp_path, old, new, said):
    text = HALVES.replace(old, new, 1) if old else new + HALVES
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'two.toml'}: ")
    assert re.search(said, str(caught.value))
    assert str(caught.value).count("two.toml") == 1


def test_a_file_without_participants_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"has no \[participants\]; add \[participants\.NAME\]"):
        read(tmp_path, "step = 1e-3\n")


def test_participants_that_were_built_are_closed_where_another_cannot_be(tmp_path, monkeypatch):
    closed = []
    monkeypatch.setattr(LeftOscillator, "close", lambda self: closed.append(self.name))
    with pytest.raises(InputError):
        read(tmp_path, HALVES.replace("RightOscillator", "Missing"))
    assert closed == ["near"]


def test_a_class_beside_the_file_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path])  # what is added is taken back
    (tmp_path / "beside_the_file.py").write_text(
        f"from {WHERE} import LeftOscillator\n\n\nclass Mine(LeftOscillator):\n    pass\n"
    )
    setup = read(tmp_path, HALVES.replace(f"{WHERE}:LeftOscillator", "beside_the_file:Mine"))
    assert type(setup.system.participants["left"]).__name__ == "Mine"
    monkeypatch.delitem(sys.modules, "beside_the_file")
