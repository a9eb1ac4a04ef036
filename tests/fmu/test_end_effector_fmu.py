"""FMUs of the end effector and its control program, and an SSP of the whole in a foreign master."""

import numpy as np
import pytest
from ecos import by_hand, in_ecos

from bench.fmu_models import Slave
from snarelab.cosim.participants.control_program import ControlProgram
from snarelab.cosim.participants.fmu import Fmu
from snarelab.cosim.setup import Setup
from snarelab.cosim.ssp_write import write_ssp
from snarelab.cosim.system import System
from snarelab.cosim.whole_capture import connections
from snarelab.fmu.export import export

NAMES = {"program": "control_program", "effector": "hover_end_effector", "snare": "hover_commanded_snare"}
SIZE, STEPS = 2.0**-8, 8


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fmus")


def made(folder, who, version):
    path = folder / f"{who}{version}.fmu"
    if not path.is_file():
        export(NAMES[who], version, path)
    return path


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("who", ["program", "effector"])
def test_the_fmus_are_valid(folder, who, version):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(made(folder, who, version))) == []


@pytest.mark.parametrize("version", [2, 3])
def test_the_control_program_runs_as_an_fmu(folder, version):
    """The same commands and states as natively: closing, then opened again, since no pin is enclosed."""
    s, p = Slave(made(folder, "program", version), folder / f"program{version}"), ControlProgram()
    inputs = p.names("input")
    for k in range(60):
        values = dict.fromkeys(inputs, 0.0) | {"angle.ring": 0.05 * k, "enclosed": 0.0}
        s.set(values)
        s.step(0.0625)
        p.set_inputs(np.array([values[name] for name in inputs]))
        p.step(k * 0.0625, 0.0625)
        np.testing.assert_array_equal(s.get(p.names("output")), p.outputs())
    s.close()
    assert p.state == "OPEN"


@pytest.mark.slow
def test_the_whole_end_effector_runs_in_ecos_from_our_ssp_file(folder, tmp_path):
    """Ecos holds inputs over a step and moves all at once: the same loop by hand gives the same numbers."""
    pytest.importorskip("libcosimpy")
    fmus = {who: Fmu(made(folder, who, 2), who) for who in NAMES}
    wires = connections()
    write_ssp(Setup(System(fmus, wires, name="end_effector"), step=SIZE, stop=SIZE * STEPS), tmp_path / "whole.ssp")

    slaves = {who: Slave(made(folder, who, 2), folder / f"{who}2") for who in NAMES}
    shown = ["effector::travel", "effector::pos.carriage.x", "snare::angle.ring", "program::rate.ring", "effector::gap"]
    wanted = by_hand(slaves, wires, SIZE, STEPS, shown)
    found = in_ecos(tmp_path / "whole.ssp", SIZE, STEPS, shown)
    assert wanted[2] > 0  # the ring turns, as the program told it
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)
