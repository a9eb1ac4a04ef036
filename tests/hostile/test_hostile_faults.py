"""A full disk, a closed pipe, an interrupt, a kill: one line, the documented status, whole files."""

import io
import os
import pty
import resource
import signal
import subprocess
import sys
import time
from contextlib import suppress
from typing import Any

import pandas as pd
import pytest

from bench.killed import kill_all
from bench.kills import Killed, words, write_inputs
from snarelab import cli
from snarelab.errors import InputError
from snarelab.files import written_whole
from snarelab.progress import Progress, duration, stages, start_logging

IDENTIFY = ["identify", "arm3.toml", "train.csv"]
DIAGNOSE = ["diagnose", "arm3.toml", "train.csv", "--holdout", "holdout.csv", "--json", "out.json"]


@pytest.fixture
def folder(tmp_path):
    write_inputs(tmp_path)
    return tmp_path


def start(folder, arguments, **options):
    command = [sys.executable, "-m", "snarelab.cli", *arguments]
    streams: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    return subprocess.Popen(command, cwd=folder, text=True, start_new_session=True, **streams)


def files(folder):
    return {p.name for p in folder.iterdir()}


@pytest.mark.usefixtures("compiler")
def test_disk_full_while_a_result_is_written(folder):
    before = files(folder)
    process = start(
        folder,
        [*IDENTIFY, "--json", "out.json"],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)),
    )
    out, error = process.communicate(timeout=100)
    assert process.returncode == 2, error
    assert out == ""
    assert error == "snarelab: out.json: cannot be written: File too large; choose another folder\n"
    assert files(folder) == before


@pytest.mark.parametrize("fault", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_file_that_cannot_be_finished_leaves_what_was_there(tmp_path, fault):
    path = tmp_path / "out.json"
    path.write_text("before")
    with pytest.raises((InputError, KeyboardInterrupt)), written_whole(path) as part:  # noqa: PT012  the file is written inside
        part.write_text("half")
        raise fault
    assert path.read_text() == "before"
    assert files(tmp_path) == {"out.json"}


def test_what_a_killed_process_left_is_swept_away(tmp_path):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    for owner in (gone.pid, os.getppid()):
        (tmp_path / f".out.json.{owner}.part").write_text("half")
    with written_whole(tmp_path / "out.json") as part:
        part.write_text("whole")
    assert files(tmp_path) == {"out.json", f".out.json.{os.getppid()}.part"}


@pytest.mark.parametrize(
    ("place", "status", "line"),
    [
        ("/dev/full", 2, "snarelab: standard output: No space left on device; make room and run again\n"),
        (None, 0, ""),  # a pipe that nobody reads any more, as after `head`
    ],
)
def test_standard_output_that_takes_nothing(monkeypatch, capfd, place, status, line):
    if place is None:
        read, write = os.pipe()
        os.close(read)
    else:
        write = os.open(place, os.O_WRONLY)
    with os.fdopen(write, "w") as closed:
        monkeypatch.setattr(sys, "stdout", closed)
        monkeypatch.setattr(cli, "_identify", lambda given: print("the result"))
        assert cli.main(IDENTIFY) == status
    assert capfd.readouterr().err == line


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_either_signal_is_an_interrupt(monkeypatch, capfd, kind):
    before = signal.getsignal(kind)
    monkeypatch.setattr(cli, "_identify", lambda given: signal.raise_signal(kind))
    assert cli.main(IDENTIFY) == 130
    assert capfd.readouterr().err.startswith("snarelab: interrupted; ")
    assert signal.getsignal(kind) == before


def test_an_interrupt_that_python_drops_is_raised_again(monkeypatch, capfd):
    class Dying:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)  # what is raised in here is dropped

    def long_work(given):
        with Progress() as show:
            Dying()
            show("goes on")

    monkeypatch.setattr(cli, "_identify", long_work)
    assert cli.main(IDENTIFY) == 130
    assert len(capfd.readouterr().err.splitlines()) == 1


def test_an_interrupted_diagnosis_says_so_and_leaves_nothing(folder):
    before = files(folder)
    process = start(folder, [*DIAGNOSE, "-v"])
    assert process.stderr is not None
    line = ""
    while "comparing each effect" not in line:
        line = process.stderr.readline()
        assert line
    time.sleep(0.3)
    os.killpg(process.pid, signal.SIGINT)
    out, error = process.communicate(timeout=60)
    assert process.returncode == 130, error
    assert out == ""
    assert error.splitlines()[-1] == "snarelab: interrupted; files that are there are whole; run the same command again"
    assert "Traceback" not in error
    assert files(folder) == before


@pytest.mark.slow
def test_an_interrupted_tolerance_study_keeps_its_cases_and_goes_on(folder):
    paths = {"PYTHONPATH": os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])}
    process = start(folder, words("tolerance", "."), env=os.environ | paths | {"CASE_SECONDS": "0.3"})
    assert process.stderr is not None
    line = ""
    while " recorded" not in line:
        line = process.stderr.readline()
        assert line
    os.killpg(process.pid, signal.SIGINT)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130, error
    last = error.splitlines()[-1]
    assert last.startswith("snarelab: interrupted; ")
    assert last.endswith(" cases are kept, the same command resumes it")
    assert "Traceback" not in error
    again = start(folder, words("tolerance", "."), env=os.environ | paths)
    _, error = again.communicate(timeout=100)
    assert again.returncode == 0, error
    assert len(pd.read_parquet(folder / "results" / "cases.parquet")) == 24


@pytest.mark.slow
def test_kills_at_random_moments():
    kinds = ["identify", "cosim"]  # of tolerance: tests/tolerance/test_tolerance_run.py; all: bench/kills.py
    done = kill_all(kinds, Killed, 4, seed=5)
    assert all(done[kind].total() == 2 for kind in kinds)


@pytest.mark.parametrize(
    ("verbosity", "lines"), [([], []), (["-v"], ["fit, 1 of 3"]), (["-vv"], ["fit, 1 of 3", "fit, 2 of 3"])]
)
def test_quiet_in_a_pipe_and_logged_where_asked(monkeypatch, capfd, verbosity, lines):
    def long_work(given):
        with Progress() as show:
            show("fit, 1 of 3")
            show("fit, 2 of 3")

    monkeypatch.setattr(cli, "_identify", long_work)
    assert cli.main([*IDENTIFY, *verbosity]) == 0
    told = capfd.readouterr().err.splitlines()
    assert [line.partition(" snarelab: ")[2] for line in told] == lines


@pytest.mark.usefixtures("compiler")
def test_progress_on_a_terminal_is_rewritten_and_gone_at_the_end(folder):
    leader, follower = pty.openpty()
    with start(folder, IDENTIFY, stderr=follower, stdout=subprocess.DEVNULL) as process:
        os.close(follower)
        shown = b""
        with suppress(OSError):  # raised where the terminal's other end is closed
            while block := os.read(leader, 4096):
                shown += block
    os.close(leader)
    assert process.returncode == 0
    assert b"reading and conditioning the recordings" in shown
    assert b"\n" not in shown
    assert shown.endswith(b"\r\x1b[2K")


def test_stages_are_told_once_and_rounds_by_their_number():
    told = []
    show = stages(told.append)
    for text in ("reading", "starting values, 1 of 7 independent parts", "starting values, 2 of 7 independent parts"):
        show(text)
    for text in ("round 1: judging, 0 of 190", "round 1: judging, 19 of 190", "round 2: judging, 0 of 189"):
        show(text)
    assert told == ["  reading", "  starting values", "  round 1: judging", "  round 2: judging"]


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_time_left_is_extrapolated_from_the_share_done(monkeypatch):
    terminal, clock = Terminal(), iter([0.0, 0.0, 10.0, 40.0])
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    with Progress() as show:
        show("case 1 of 5")
        show("case 2 of 5")  # one in 10 s: three more to go
        show("now at 0.5 s", 0.5)
    assert "[10 s, 0.1/s, 30 s left] ━━━━────── case 2 of 5" in terminal.getvalue()
    assert "[40 s] ━━━━━───── now at 0.5 s" in terminal.getvalue()


def test_no_time_left_is_not_said_again_and_again(monkeypatch):
    terminal, clock = Terminal(), iter([0.0, 0.0, 10.0, 40.0])
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    with Progress() as show:
        show("case 1 of 3")
        show("case 2 of 3")
        show("case 3 of 3")
    assert "[10 s, 0.1/s, 10 s left]" in terminal.getvalue()
    assert "[40 s, 3/min] ━━━━━━━━━━ case 3 of 3" in terminal.getvalue()
    assert "0 s left]" not in terminal.getvalue().replace("10 s left]", "")


def test_a_line_of_progress_does_not_wrap(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("COLUMNS", "60")
    with Progress() as show:
        show("screening " + 40 * "every effect at every place ")
    longest = max(len(line) for line in terminal.getvalue().split("\r\x1b[2K"))
    assert longest == 59


@pytest.mark.parametrize(("seconds", "text"), [(8.4, "8 s"), (125, "2 min 05 s"), (12_000, "3 h 20 min"), (-1, "0 s")])
def test_durations(seconds, text):
    assert duration(seconds) == text


def test_what_a_message_quotes_cannot_steer_the_terminal(tmp_path, capsys):
    (tmp_path / "model.toml").write_text('"\\u001b[2J\\u0007\\n\\u202e" = 1\n', encoding="utf-8")
    assert (
        cli.main(["simulate", str(tmp_path / "model.toml"), "--motion", "x.csv", "--out", str(tmp_path / "o.csv")]) == 2
    )
    error = capsys.readouterr().err
    assert error[:-1].isprintable()
    assert len(str(InputError("x" * 10**6))) < 5000


@pytest.fixture(autouse=True)
def _logging_as_it_was():
    yield
    start_logging(0)
