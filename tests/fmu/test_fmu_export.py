"""``snarelab export``: what it writes, and what it refuses in one line, with nothing written."""

import argparse

import numpy as np
import pytest

from bench.fmu_models import write_model
from snarelab.errors import InputError
from snarelab.fmi.archive import open_fmu
from snarelab.fmu.command import add_parser
from snarelab.fmu.elements import ELEMENTS
from snarelab.fmu.export import model_equations
from snarelab.models.model_file import load_model


def run(*given):
    parser = argparse.ArgumentParser()
    add_parser(parser.add_subparsers(required=True))
    options = parser.parse_args(["export", *map(str, given)])
    options.run(options)


def test_by_the_command(tmp_path, capsys):
    path = write_model(tmp_path, "my arm-2", 1, '["viscous_friction"]', {"viscous_friction.joint1.coefficient": 2.0})
    run(path, "--fmi", 2, "--out", tmp_path / "x.fmu")
    assert "FMI 2.0" in capsys.readouterr().out
    found = open_fmu(tmp_path / "x.fmu", tmp_path / "x")
    assert found.description.coSimulation.modelIdentifier == "my_arm_2"
    run(path, "--fmi", 3, "--out", tmp_path / "i.fmu", "--inverse")
    assert open_fmu(tmp_path / "i.fmu", tmp_path / "i").version == 3


def refused(tmp_path, match, *given):
    before = sorted(tmp_path.iterdir())
    with pytest.raises(InputError, match=match) as caught:
        run(*given)
    assert "\n" not in str(caught.value)
    assert sorted(tmp_path.iterdir()) == before


def test_refusals(tmp_path):
    path = write_model(tmp_path, "arm", 1, '["viscous_friction"]', {})
    out = tmp_path / "x.fmu"
    refused(tmp_path, r"known participants: .*joint_friction.*suspended_target", "nobody", "--fmi", 2, "--out", out)
    refused(tmp_path, r"no value for 'viscous_friction.joint1.coefficient'", path, "--fmi", 2, "--out", out)
    refused(tmp_path, r"no such model file", tmp_path / "none.toml", "--fmi", 2, "--out", out)
    refused(tmp_path, r"ends in .fmu", "joint_friction", "--fmi", 2, "--out", tmp_path / "x.zip")
    refused(tmp_path, r"folder does not exist", "joint_friction", "--fmi", 2, "--out", tmp_path / "no" / "x.fmu")
    refused(tmp_path, r"--inverse is for model files", "joint_friction", "--fmi", 2, "--out", out, "--inverse")
    capture = tmp_path / "capture.toml"
    capture.write_text('system = "snare_capture"\neffects = ["contact_friction"]\n')
    refused(tmp_path, r"no value for 'contact_friction.pin.coefficient'", capture, "--fmi", 2, "--out", out)
    stiff = "--integrator", "rosenbrock"
    refused(tmp_path, r"nothing is integrated .*--integrator", path, "--fmi", 2, "--out", out, "--inverse", *stiff)
    refused(tmp_path, r"nothing is integrated .*--integrator", capture, "--fmi", 2, "--out", out, *stiff)
    refused(tmp_path, r"--integrator is for the arms", "joint_friction", "--fmi", 2, "--out", out, *stiff)
    refused(tmp_path, r"a capture has none", capture, "--fmi", 2, "--out", out, "--inverse")


def test_the_built_in_satellite_from_a_model_file_is_the_one_by_name(tmp_path):
    (tmp_path / "ets.toml").write_text('name = "ets"\nsystem = "free_floating_arm"\n')
    found, wanted = model_equations(load_model(tmp_path / "ets.toml")), ELEMENTS["ets_vii_arm"]()
    rng = np.random.default_rng(0)
    x, u = rng.normal(size=found.n_states), rng.normal(size=len(found.of("input")))
    values = [np.array(e.functions["rate"](0, x, u, e.starts("parameter"))) for e in (found, wanted)]
    np.testing.assert_array_equal(values[0], values[1])


def test_no_compiler(tmp_path, monkeypatch):
    monkeypatch.setenv("SNARELAB_CC", "none")
    refused(tmp_path, r"needs a C compiler.*SNARELAB_CC", "joint_friction", "--fmi", 3, "--out", tmp_path / "x.fmu")
