"""System files, TOML and SSP, and the command that runs them."""

import argparse
import re
import signal
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from snarelab.cosim.command import add_parser
from snarelab.cosim.participants.oscillator import RightOscillator
from snarelab.cosim.setup import Hosting, load_setup
from snarelab.errors import InputError

HERE = Hosting(own_process=False)
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the test FMUs are built for Linux")


TOML = """
step = 2e-3
stop = 0.5
scheme = "gauss_seidel"

[participants.left]
fmu = "left2.fmu"
parameters = { mass = 2 }

[participants.right]
python = "snarelab.cosim.participants.oscillator:RightOscillator"
own_process = false

[connections]
"left.force" = "right.force"
"right.x_left" = { source = "left.x", factor = 1.0 }
"right.v_left" = "left.v"

[bonds]
spring = { effort = "right.force", flow = "left.v" }
"""


def written(halves, text=TOML, name="system.toml"):
    (halves / name).write_text(text)
    return halves / name


def command(*arguments):
    parser = argparse.ArgumentParser()
    add_parser(parser.add_subparsers())
    given = parser.parse_args(["cosim", *map(str, arguments)])
    given.run(given)


# TOML


def test_toml_becomes_a_run(halves):
    setup = load_setup(written(halves), HERE)
    assert (setup.step, setup.stop, setup.scheme, setup.hold) == (2e-3, 0.5, "gauss_seidel", "midpoint")
    with setup.master() as master:
        run = master.run(setup.stop)
    assert run.steps == 250
    assert set(run.residual) == {"spring"}
    assert setup.system.parameters_of("left") == {"mass": 2.0}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("step = 2e-3", "steps = 2e-3", "file: 'steps' is unknown; nearest is 'step'"),
        ("step = 2e-3", "step = 'fast'", "step: 'fast' is not a number"),
        ('fmu = "left2.fmu"', 'fmu = "lost.fmu"', "lost.fmu: is not there"),
        ('fmu = "left2.fmu"', "", "give either fmu = a file or python"),
        ("RightOscillator", "Oscillator", "cannot be imported"),
        ("snarelab.cosim.participants.oscillator:RightOscillator", "math:sqrt", "is no participant"),
        ('"left.force" = "right.force"', '"left.force" = "right.forse"', "nearest output is 'right.force'"),
        ("factor = 1.0", "gain = 1.0", "'gain' is unknown; nearest is"),
        ('flow = "left.v"', 'flow = "left.x"', "is not a power"),
        ("[bonds]", "[[bonds]]", "bonds: "),
        ("parameters = { mass = 2 }", "parameters = { mas = 2 }", "nearest parameter is 'left.mass'"),
        ("[connections]", "[connections", "not a TOML file"),
        ('scheme = "gauss_seidel"', 'scheme = "both"', "choose jacobi or gauss_seidel"),
    ],
)
def test_mistakes_in_toml_are_named_with_the_file(halves, tmp_path, old, new, message):
    assert old in TOML
    text = TOML.replace(old, new).replace('"left2.fmu"', f'"{halves}/left2.fmu"')
    path = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        command(path, "--out", tmp_path / "run.csv", "--same-process")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value) or "lost.fmu" in str(caught.value)
    assert not (tmp_path / "run.csv").exists()


# The command


def test_command_writes_the_recording(halves, tmp_path, capsys):
    command(written(halves), "--out", tmp_path / "run.parquet", "--until", "0.1", "--step", "0.01")
    table = pd.read_parquet(tmp_path / "run.parquet")
    np.testing.assert_allclose(table["time"], np.arange(11) * 0.01, atol=1e-12)
    assert {"left.x [m]", "right.force [N]", "residual.spring [J]"} <= set(table)
    assert "10 steps" in capsys.readouterr().out


def test_failed_run_keeps_its_recording(halves, tmp_path):
    text = TOML.replace("mass = 2", "mass = 2, fault = 4, fault_time = 0.1")  # 4: the FMU kills its process
    with pytest.raises(InputError) as caught:
        command(written(halves, text, "bad.toml"), "--out", tmp_path / "run.csv")
    message = str(caught.value)
    assert "left: its process was killed by SIGKILL in the step from 0.1 s; last good step ended at 0.1 s" in message
    assert str(tmp_path / "run.csv") in message
    assert len(pd.read_csv(tmp_path / "run.csv")) == 51


def test_a_run_that_fails_in_its_first_step_leaves_nothing(halves, tmp_path):
    text = TOML.replace("mass = 2", "mass = 2, fault = 1, fault_time = 0.0")
    with pytest.raises(InputError, match="no step was made, nothing is written"):
        command(written(halves, text, "bad.toml"), "--out", tmp_path / "run.csv")
    assert not (tmp_path / "run.csv").exists()


def test_interrupted_run_keeps_its_recording(halves, tmp_path, monkeypatch, capsys):
    def stopped(participant, time, size):
        if time > 0.1:
            signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr(RightOscillator, "step", stopped)
    with pytest.raises(SystemExit) as caught:
        command(written(halves), "--out", tmp_path / "run.csv", "--same-process")
    assert caught.value.code == 130
    assert len(pd.read_csv(tmp_path / "run.csv")) == 51 + 1
    assert "interrupted at 0.102 s" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["run.txt", "nowhere/run.csv"])
def test_command_refuses_a_bad_place_before_it_runs(halves, tmp_path, name):
    with pytest.raises(InputError):
        command(written(halves), "--out", tmp_path / name)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--until", "inf"], "cannot run to inf s"),
        (["--until", "nan"], "cannot run to nan s"),
        (["--timeout", "inf"], "--timeout inf: must be positive and finite"),
        (["--timeout", "0"], "--timeout 0.0: must be positive and finite"),
    ],
)
def test_command_refuses_a_time_without_end(halves, tmp_path, more, message):
    with pytest.raises(InputError, match=message):
        command(written(halves), "--out", tmp_path / "run.csv", *more)
    assert not (tmp_path / "run.csv").exists()


def test_command_refuses_other_files(tmp_path):
    (tmp_path / "system.json").write_text("{}")
    for name, message in (("system.json", "is .ssp or .toml"), ("gone.ssp", "is not there")):
        with pytest.raises(InputError, match=message):
            command(tmp_path / name, "--out", tmp_path / "run.csv")


# The documentation


def blocks(language):
    page = (Path(__file__).resolve().parents[2] / "docs" / "cosimulation.md").read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", page, re.MULTILINE | re.DOTALL)


def test_python_of_the_page_runs():
    names = {}
    for block in blocks("python"):
        exec(block, names)
    assert names["run"].steps == 1000


def test_system_file_of_the_page_loads(halves):
    (shown,) = [block for block in blocks("toml") if "[participants.left]" in block]
    assert load_setup(written(halves, shown.replace('"left.fmu"', '"left2.fmu"')), HERE).master().run(0.05).steps == 50
