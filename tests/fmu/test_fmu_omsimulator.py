"""FMUs in OMSimulator, where it is on the PATH; pip's package has no binaries, so mostly it is not."""

import csv
import shutil
import subprocess

import numpy as np
import pytest

from bench.fmu_models import Slave, everywhere, write_model
from snarelab.fmu.export import export

TOOL = shutil.which("OMSimulator")


@pytest.mark.skipif(TOOL is None, reason="OMSimulator is not installed")
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", ["arm", "left_oscillator"])
def test_the_command_line_gives_the_same_motion(tmp_path, name, version):
    """One FMU, 0.2 s in steps of 1 ms from its own start values: an arm that falls, a mass on a spring."""
    values = everywhere("viscous_friction", "coefficient", [3.0, 2.0])
    model = write_model(tmp_path, "arm", 2, '["viscous_friction"]', values)
    export(str(model) if name == "arm" else name, version, tmp_path / "x.fmu")
    command = [str(TOOL), "x.fmu", "--mode=cs", "--stopTime=0.2", "--stepSize=0.001", "--resultFile=out.csv"]
    run = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    with (tmp_path / "out.csv").open() as file:
        rows = list(csv.reader(file))
    found = {head: float(x) for head, x in zip(rows[0], rows[-1], strict=True)}
    s = Slave(tmp_path / "x.fmu", tmp_path / "x")
    for _ in range(200):
        s.step(1e-3)
    shown = ["q.joint1", "q.joint2", "qd.joint1"] if name == "arm" else ["x", "v"]
    wanted = s.get(shown)
    s.close()
    assert np.abs(wanted).max() > 0.01
    np.testing.assert_allclose([found[key] for key in shown], wanted, rtol=0, atol=1e-9)
