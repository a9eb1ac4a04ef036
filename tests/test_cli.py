"""The command line: what it says, where, with which status, and that a mistake leaves nothing behind."""

import io
import json
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io

import snarelab
import snarelab.identification.identify
from bench.arm import random_arm
from snarelab.cli import main

MODEL = 'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\neffects = ["viscous_friction"]\n'


def table(seed, seconds=6.0, rate=100.0):
    """Two joints that move, with torques of no physical meaning: these tests are about paths, not physics."""
    rng, t = np.random.default_rng(seed), np.arange(round(seconds * rate)) / rate
    columns = {"time": t}
    for k, joint in enumerate(("joint1", "joint2"), 1):
        columns[f"q.{joint}"] = np.sin((1.3 + 0.4 * k + 0.1 * seed) * t) + 0.3 * np.sin(4.1 * k * t + seed)
        columns[f"tau.{joint}"] = 5.0 * np.cos(2.0 * k * t) + 0.1 * rng.normal(size=len(t))
    return pd.DataFrame(columns)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "arm.urdf").write_text(random_arm(np.random.default_rng(0), 2).urdf())
    (tmp_path / "arm.toml").write_text(MODEL)
    table(0).to_csv(tmp_path / "train.csv", index=False)
    table(1).to_csv(tmp_path / "hold.csv", index=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def arguments(command, recording="train.csv", model="arm.toml", holdout="hold.csv"):
    outputs = ["--json", "out.json", "--save-model", "new.toml"]
    if command == "simulate":
        return [command, model, "--motion", recording, "--out", "out.csv"]
    if command == "diagnose":
        outputs += ["--report", "out.html"]
    return [command, model, recording, "--holdout", holdout, *outputs]


def refused(capfd, given, *words):
    """One line on standard error with all the words, status 2, and no file more or less, or changed."""
    here = Path.cwd()

    def state():
        return {p: p.read_bytes() if p.is_file() else None for p in here.rglob("*")}

    before = state()
    capfd.readouterr()
    assert main(given) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.endswith("\n")
    assert err.count("\n") == 1, err
    assert err.startswith("snarelab: ")
    assert "Traceback" not in err
    for word in words:
        assert word in err, err
    assert state() == before
    return err


def edited(change):
    """A mistake made in the good recording's table."""

    def make():
        frame = table(0)
        change(frame).to_csv("bad.csv", index=False)
        return {"recording": "bad.csv"}

    return make


def raw(name, content):
    """A recording of these bytes."""

    def make():
        Path(name).write_bytes(content)
        return {"recording": name}

    return make


def model(text):
    def make():
        Path("bad.toml").write_text(text)
        return {"model": "bad.toml"}

    return make


def backwards(frame):
    frame.loc[300, "time"] = 1.25
    return frame


def stray(frame):
    frame["tau.joint2"] = frame["tau.joint2"].astype(object)
    frame.loc[41, "tau.joint2"] = "overload"
    return frame


def cut_mat():
    scipy.io.savemat("bad.mat", {name: table(0)[name].to_numpy() for name in ("time", "q.joint1")})
    content = Path("bad.mat").read_bytes()
    Path("bad.mat").write_bytes(content[: len(content) // 2])
    return {"recording": "bad.mat"}


def unphysical():
    urdf = Path("arm.urdf").read_text()
    start = urdf.index('ixx="', urdf.index('<link name="link2">')) + 5
    Path("bad.urdf").write_text(urdf[:start] + "9.0" + urdf[urdf.index('"', start) :])
    return model(MODEL.replace("arm.urdf", "bad.urdf"))()


MAPPED = MODEL + '[signals]\n"tau.joint1" = { column = "tau.jiont1", unit = "N*m" }\n'
MISTAKES = {
    "missing file": (lambda: {"recording": "none.csv"}, ("none.csv", "no such file")),
    "missing mapped column": (model(MAPPED), ("train.csv", "'tau.jiont1'", "nearest is 'tau.joint1'")),
    "missing column": (
        edited(lambda f: f.rename(columns={"q.joint2": "q.jont2"})),
        ("bad.csv", "'q.joint2'", "nearest is 'q.jont2'"),
    ),
    "time backwards": (edited(backwards), ("bad.csv", "'time'", "backwards in row 302", "1.25 s after 2.99 s")),
    "unit": (
        edited(lambda f: f.rename(columns={"q.joint1": "q.joint1 [kg]"})),
        ("bad.csv", "'q.joint1 [kg]'", "does not fit", "rad"),
    ),
    "unknown unit": (edited(lambda f: f.rename(columns={"tau.joint1": "tau.joint1 [Nmm!]"})), ("bad.csv", "Nmm!")),
    "all NaN": (edited(lambda f: f.assign(**{"tau.joint1": np.nan})), ("bad.csv", "'tau.joint1'", "no number")),
    "joint without signal": (
        edited(lambda f: f.drop(columns=["q.joint2", "tau.joint2"])),
        ("bad.csv", "'q.joint2'", "q.joint1, tau.joint1", "[signals]"),
    ),
    "no time": (edited(lambda f: f.rename(columns={"time": "tmie"})), ("bad.csv", "no column 'time'", "tmie")),
    "too few samples": (edited(lambda f: f[:60]), ("bad.csv", "too few samples", "60 rows", "at least 50")),
    "three rows": (edited(lambda f: f[:3]), ("bad.csv", "too few samples", "3 rows")),
    "one row": (edited(lambda f: f[:1]), ("bad.csv", "1 rows")),
    "no two channels at once": (
        edited(
            lambda f: f.assign(
                **{
                    "q.joint1": f["q.joint1"].where(f.index % 2 == 0),
                    "tau.joint1": f["tau.joint1"].where(f.index % 2 == 1),
                }
            )
        ),
        ("bad.csv", "too few samples"),
    ),
    "stray text": (edited(stray), ("bad.csv", "'tau.joint2'", "row 43", "overload")),
    "corrupt MAT": (raw("bad.mat", b"MATLAB 5.0 MAT-file" + bytes(range(256)) * 3), ("bad.mat",)),
    "MAT cut off": (cut_mat, ("bad.mat",)),
    "corrupt Parquet": (raw("bad.parquet", b"PAR1 and nothing more"), ("bad.parquet",)),
    "corrupt HDF5": (raw("bad.h5", b"\x89HDF\r\n\x1a\n" + bytes(64)), ("bad.h5",)),
    "corrupt MCAP": (raw("bad.mcap", b"\x89MCAP0\r\n" + bytes(64)), ("bad.mcap",)),
    "empty file": (raw("bad.csv", b""), ("bad.csv", "empty")),
    "bytes": (raw("bad.csv", bytes(range(256)) * 10), ("bad.csv",)),
    "unknown suffix": (raw("bad.xlsx", b"PK"), ("bad.xlsx", ".csv")),
    "missing model": (lambda: {"model": "none.toml"}, ("none.toml", "no such")),
    "unknown effect": (
        model(MODEL.replace("viscous", "viscuos")),
        ("bad.toml", "'viscuos_friction'", "nearest: viscous_friction", "coulomb_friction", "sensor_delay"),
    ),
    "broken TOML": (model(MODEL + "[signals\n"), ("bad.toml", "not a TOML file", "line 5")),
    "joint in signals": (
        model(MAPPED.replace('"tau.joint1"', '"tau.joint7"')),
        ("bad.toml", "'tau.joint7'", "joint1, joint2"),
    ),
    "missing URDF": (model(MODEL.replace("arm.urdf", "amr.urdf")), ("amr.urdf", "no such file")),
    "unphysical URDF": (unphysical, ("bad.urdf", "'link2'", "nearest", "ixx=")),
    "bandwidth": (model(MODEL + "bandwidth = 45\n"), ("train.csv", "45 Hz", "100 samples a second", "<= 40 Hz")),
}


@pytest.mark.parametrize("mistake", MISTAKES)
@pytest.mark.parametrize("command", ["identify", "diagnose", "simulate"])
def test_a_mistake_gives_one_line_and_nothing_else(folder, capfd, command, mistake):
    make, words = MISTAKES[mistake]
    refused(capfd, arguments(command, **make()), *words)


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_a_torque_channel_of_zeros(folder, capfd, command):
    make = edited(lambda f: f.assign(**{"tau.joint1": 0.0}))
    refused(capfd, arguments(command, **make()), "bad.csv", "'tau.joint1'", "zero in every row")


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_a_mistake_in_the_second_or_held_out_recording(folder, capfd, command):
    stray(table(2)).to_csv("bad.csv", index=False)
    refused(capfd, arguments(command, holdout="bad.csv"), "bad.csv", "row 43")
    refused(capfd, arguments(command, holdout="none.csv"), "none.csv", "no such file")
    given = arguments(command)
    refused(capfd, [*given[:3], "bad.csv", *given[3:]], "bad.csv", "row 43")


@pytest.mark.parametrize("same", ["train.csv", "./train.csv", "link.csv"])
@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_a_holdout_that_is_fitted_is_refused(folder, capfd, command, same):
    (folder / "link.csv").symlink_to("train.csv")
    refused(capfd, arguments(command, holdout=same), same, "also a recording to fit")


@pytest.mark.parametrize("option", ["--json", "--save-model", "--report", "--out"])
@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("none/x", "folder does not exist"),
        ("arm.urdf/x", "folder does not exist"),
        (".", "no plain file"),
        ("train.csv", "recording that is read"),
    ],
)
def test_an_output_that_cannot_be_written_is_refused_before_any_work(folder, capfd, monkeypatch, option, place, words):
    monkeypatch.setattr("snarelab.models.model_file.load_model", None)  # any work would fail
    given = arguments("simulate" if option == "--out" else "diagnose")
    given[given.index(option) + 1] = place
    refused(capfd, given, f"snarelab: {place}: ", words)


def test_two_outputs_in_one_place_are_refused(folder, capfd):
    refused(capfd, [*arguments("identify")[:-1], "out.json"], "out.json", "another output")


@pytest.mark.parametrize(
    "given", [[], ["identify"], ["diagnose", "arm.toml", "train.csv"], ["diagnoze"], ["simulate", "a"]]
)
def test_a_command_that_is_not_complete(folder, capfd, given):
    with pytest.raises(SystemExit) as stopped:
        main(given)
    assert stopped.value.code == 2
    said = capfd.readouterr().err
    assert said.count("\n") == 1
    assert said.endswith("--help\n")


def test_version(capfd):
    with pytest.raises(SystemExit) as stopped:
        main(["--version"])
    assert stopped.value.code == 0
    assert capfd.readouterr().out.strip() == snarelab.__version__


def test_identify_writes_what_is_asked_and_says_it(folder, capfd):
    assert main(arguments("identify")) == 0
    out, err = capfd.readouterr()
    assert err == ""
    found = json.loads((folder / "out.json").read_text())
    keys = {"effect", "at", "name", "value", "std", "unit", "at_bound", "identifiable"}
    assert [(set(p), p["effect"], p["at"]) for p in found["parameters"]] == [
        (keys, "viscous_friction", "joint1"),
        (keys, "viscous_friction", "joint2"),
    ]
    for fit in found["fit"].values():
        assert set(fit) == {"train", "holdout", "unit"}
        assert set(fit["train"]) == {"rms", "relative"}
    assert f"{found['parameters'][0]['value']:.5g}" in out
    assert "viscous_friction" in (folder / "new.toml").read_text()
    names = {"arm.urdf", "arm.toml", "train.csv", "hold.csv"}
    assert {p.name for p in folder.iterdir()} == names | {"out.json", "new.toml"}


def test_the_program_itself(folder):
    """As a user starts it: JSON alone on standard output, nothing on a piped standard error; one line for a mistake."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "snarelab.cli", "identify", "arm.toml"]
    good = subprocess.run([*command, "train.csv", "--json", "-"], capture_output=True, text=True, env=environment)
    assert (good.returncode, good.stderr) == (0, "")
    assert len(json.loads(good.stdout)["parameters"]) == 2
    bad = subprocess.run([*command, "none.csv", "--json", "-"], capture_output=True, text=True, env=environment)
    assert (bad.returncode, bad.stdout) == (2, "")
    assert bad.stderr.startswith("snarelab: none.csv: ")
    assert bad.stderr.count("\n") == 1


def test_diagnose_of_a_recording_in_pieces(folder, capfd):
    """JSON alone on standard output. Every second a sample is missing, and the torque is no arm's: a hard case to get
    through, with joints whose friction ends at its bound.
    """
    frame = table(0, seconds=25.0)
    frame.loc[::104, "q.joint1"] = np.nan
    frame.to_csv("gaps.csv", index=False)
    given = arguments("diagnose", recording="gaps.csv")
    given[given.index("out.json")] = "-"
    assert main(given) == 0
    out, err = capfd.readouterr()
    assert err == ""
    found = json.loads(out)
    assert found["verdict"] in ("missing_physics", "adequate", "unknown_effect")
    assert set(found["fit"]) == {"tau.joint1", "tau.joint2"}
    assert "<html" in (folder / "out.html").read_text(encoding="utf-8")[:500]
    names = {"arm.urdf", "arm.toml", "train.csv", "hold.csv", "gaps.csv"}
    assert {p.name for p in folder.iterdir()} == names | {"new.toml", "out.html"}
    assert main(["simulate", "new.toml", "--motion", "hold.csv", "--out", "sim.parquet"]) == 0


def test_progress_on_a_terminal_is_one_line_that_goes_away(folder, monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    assert main(["identify", "arm.toml", "train.csv"]) == 0
    assert "reading and conditioning" in screen.getvalue()
    assert "\n" not in screen.getvalue()
    assert screen.getvalue().endswith("\r\x1b[2K")


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_interrupted_it_writes_nothing(folder, capfd, monkeypatch, command):
    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"snarelab.identification.{command}.{command}", stop)
    before = sorted(folder.iterdir())
    assert main(arguments(command)) == 130
    assert capfd.readouterr() == (
        "",
        "snarelab: interrupted; files that are there are whole; run the same command again\n",
    )
    assert sorted(folder.iterdir()) == before


def test_a_fault_of_the_program_is_not_called_a_mistake_of_the_user(folder, monkeypatch):
    def fail(*_, **__):
        raise RuntimeError("fault")

    monkeypatch.setattr("snarelab.identification.identify.identify", fail)
    with pytest.raises(RuntimeError, match="fault"):
        main(arguments("identify"))


@pytest.mark.filterwarnings("default")
def test_notices_are_one_line_each_and_leave_no_trace(folder, capfd, monkeypatch):
    real = snarelab.identification.identify.identify

    def with_notice(*given, **more):
        warnings.warn("no C compiler", UserWarning, stacklevel=2)
        warnings.warn("for programmers", DeprecationWarning, stacklevel=2)
        return real(*given, **more)

    monkeypatch.setattr("snarelab.identification.identify.identify", with_notice)
    shown = warnings.showwarning
    assert main(arguments("identify")) == 0
    assert capfd.readouterr().err == "snarelab: no C compiler\n"
    assert warnings.showwarning is shown
