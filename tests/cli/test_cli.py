"""The command line: what it says, where, with which status, and what it writes."""

import io
import json
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from arm_commands import arguments, table

import snarelab
import snarelab.identification.diagnose as diagnosing
import snarelab.identification.identify
from snarelab.cli import _notice, main
from snarelab.errors import InputError
from snarelab.progress import Progress


def test_version(capfd):
    with pytest.raises(SystemExit) as stopped:
        main(["--version"])
    assert stopped.value.code == 0
    assert capfd.readouterr().out.strip() == snarelab.__version__


def test_identify_writes_what_is_asked_and_says_it(arm_folder, capfd):
    assert main(arguments("identify")) == 0
    out, err = capfd.readouterr()
    assert err == ""
    found = json.loads((arm_folder / "out.json").read_text())
    keys = {"effect", "at", "name", "value", "std", "unit", "at_bound", "identifiable"}
    assert [(set(p), p["effect"], p["at"]) for p in found["parameters"]] == [
        (keys, "viscous_friction", "joint1"),
        (keys, "viscous_friction", "joint2"),
    ]
    for fit in found["fit"].values():
        assert set(fit) == {"train", "holdout", "unit"}
        assert set(fit["train"]) == {"rms", "relative"}
    assert f"{found['parameters'][0]['value']:.5g}" in out
    assert "viscous_friction" in (arm_folder / "new.toml").read_text()
    names = {"arm.urdf", "arm.toml", "train.csv", "hold.csv"}
    assert {p.name for p in arm_folder.iterdir()} == names | {"out.json", "new.toml"}


@pytest.mark.usefixtures("compiler")
def test_the_program_itself(arm_folder):
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


@pytest.mark.slow
@pytest.mark.filterwarnings("default:the empirical law at")
def test_diagnose_of_a_recording_in_pieces(arm_folder, capfd):
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
    assert "<html" in (arm_folder / "out.html").read_text(encoding="utf-8")[:500]
    names = {"arm.urdf", "arm.toml", "train.csv", "hold.csv", "gaps.csv"}
    assert {p.name for p in arm_folder.iterdir()} == names | {"new.toml", "out.html"}
    assert main(["simulate", "new.toml", "--motion", "hold.csv", "--out", "sim.parquet"]) == 0


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_on_a_terminal_is_one_line_that_goes_away(arm_folder, monkeypatch):
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    assert main(["identify", "arm.toml", "train.csv"]) == 0
    assert "reading and conditioning" in screen.getvalue()
    assert "\n" not in screen.getvalue()
    assert screen.getvalue().endswith("\r\x1b[2K")


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_interrupted_it_writes_nothing(arm_folder, capfd, monkeypatch, command):
    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"snarelab.identification.{command}.{command}", stop)
    before = sorted(arm_folder.iterdir())
    assert main(arguments(command)) == 130
    assert capfd.readouterr() == (
        "",
        "snarelab: interrupted; files that are there are whole; run the same command again\n",
    )
    assert sorted(arm_folder.iterdir()) == before


def test_a_fault_of_the_program_is_not_called_a_mistake_of_the_user(arm_folder, monkeypatch):
    def fail(*_, **__):
        raise RuntimeError("fault")

    monkeypatch.setattr("snarelab.identification.identify.identify", fail)
    with pytest.raises(RuntimeError, match="fault"):
        main(arguments("identify"))


@pytest.mark.filterwarnings("default")
def test_notices_are_one_line_each_and_leave_no_trace(arm_folder, capfd, monkeypatch):
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


@pytest.mark.filterwarnings("default")
def test_a_notice_takes_the_line_of_the_progress(monkeypatch):
    monkeypatch.setattr(sys, "stderr", screen := Terminal())
    with Progress() as show, warnings.catch_warnings():
        warnings.showwarning = _notice
        show("reading")
        warnings.warn("no C compiler", UserWarning, stacklevel=2)
    assert screen.getvalue().endswith("reading\r\x1b[2Ksnarelab: no C compiler\n\r\x1b[2K")


def test_quiet_says_nothing_that_was_not_asked_for(arm_folder, capfd, monkeypatch):
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    assert main([*arguments("identify"), "--quiet"]) == 0
    assert (capfd.readouterr().out, screen.getvalue()) == ("", "")
    assert (arm_folder / "out.json").is_file()
    assert main(["identify", "arm.toml", "none.csv", "-q"]) == 2
    assert screen.getvalue().startswith("snarelab: none.csv: ")


def test_every_holdout_of_identify_counts(arm_folder, capfd):
    """Of two held-out recordings, the error is that over both."""
    table(3).to_csv("third.csv", index=False)
    errors = []
    for held in (["hold.csv"], ["third.csv"], ["hold.csv", "third.csv"]):
        options = [word for name in held for word in ("--holdout", name)]
        assert main(["identify", "arm.toml", "train.csv", *options, "--json", "-"]) == 0
        errors.append(json.loads(capfd.readouterr().out)["fit"]["tau.joint1"]["holdout"]["rms"])
    assert min(errors[:2]) < errors[2] < max(errors[:2])


@pytest.mark.usefixtures("arm_folder")
def test_every_holdout_of_diagnose_is_held_out_and_the_same_again_is_refused(capfd, monkeypatch):
    table(3).to_csv("third.csv", index=False)
    seen = []

    def decide(recordings, _):
        seen.append([Path(e.motion.path).name for e in recordings.held_out])
        raise InputError("far enough")

    monkeypatch.setattr(diagnosing, "decide", decide)
    assert main(["diagnose", "arm.toml", "train.csv", "--holdout", "hold.csv", "--holdout", "third.csv"]) == 2
    assert seen == [["hold.csv", "third.csv"]]
    assert main(["diagnose", "arm.toml", "train.csv", "--holdout", "hold.csv", "--holdout", "hold.csv"]) == 2
    assert "hold.csv: is held out twice, or parts of it are; give each once" in capfd.readouterr().err


def test_comments_of_a_model_file_survive(arm_folder):
    """Saved over its own source, twice: order, spelling and comments stay, and the note is not piled up."""
    source = arm_folder / "arm.toml"
    text = source.read_text(encoding="utf-8")
    source.write_text(f"# Bench of March, gripper off.\n{text}\n# the end\n", encoding="utf-8")
    for _ in range(2):
        assert main(["identify", "arm.toml", "train.csv", "--save-model", "arm.toml"]) == 0
    saved = source.read_text(encoding="utf-8")
    assert saved.count("values from snarelab identify") == saved.count("# Bench of March, gripper off.\n") == 1
    assert saved.count("# the end") == 1
    assert all(line in saved.splitlines() for line in text.splitlines() if line.startswith(("urdf", 'effects = ["')))
    assert "viscous_friction.joint2.coefficient" in snarelab.load_model(source).values


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_completion_knows_every_command(capfd, shell):
    assert main(["completion", shell]) == 0
    script = capfd.readouterr().out
    assert all(word in script for word in ("diagnose", "identify", "holdout", "save-model", "tolerance"))


def test_bash_takes_the_completion(tmp_path):
    script = subprocess.run(
        [sys.executable, "-m", "snarelab.cli", "completion", "bash"], capture_output=True, text=True
    )
    (tmp_path / "complete").write_text(script.stdout, encoding="utf-8")
    ask = (
        'source "$1"; COMP_WORDS=(snarelab dia); COMP_CWORD=1; '
        '_shtab_snarelab snarelab dia snarelab 2>/dev/null; echo "${COMPREPLY[@]}"'
    )
    ran = subprocess.run(["bash", "-c", ask, "bash", str(tmp_path / "complete")], capture_output=True, text=True)
    assert ran.stdout.split() == ["diagnose"], ran.stderr
