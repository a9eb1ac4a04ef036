"""Nothing outlives an importer or a run: processes, temporary folders, and what FMUs have started."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bench.fmu_models import Slave
from bench.importer_kills import Importer
from bench.killed import alive, kill_all
from bench.oscillator_fmu import build
from snarelab.cosim.participant import StepError
from snarelab.cosim.participants.fmu import Fmu
from snarelab.cosim.process import OwnProcess
from snarelab.fmu.hosted import write_hosted, write_hosted_class
from snarelab.scratch import scratch_folder

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")
FORK_AND_CRASH, DAEMON, START_HANG, END_HANG = 17, 18, 51, 53

TALKING = """
import os, time
import numpy as np
from snarelab.cosim.participant import Participant, Variable

class Talking(Participant):
    name = "talking"
    variables = (Variable("u", "input", "1"), Variable("pid", "output", "1"))
    def initialize(self, time=0.0, parameters=None):
        print("a model prints", flush=True)
        self.file = open(os.path.join(os.environ["TMPDIR"], "model-file"), "w")
    def set_inputs(self, values):
        pass
    def step(self, time, size):
        os.write(1, b"x" * 100)
        os.write(2, b"y" * 100)
    def outputs(self):
        return np.array([float(os.getpid())])
"""

STEPPING = """
import os, sys, time
sys.path.append({root!r})
from bench.fmu_models import Slave
for descriptor in {closed}:
    os.close(descriptor)
slave = Slave({path!r}, {folder!r}, {{"u": 1.0}})
for k in range(3):
    slave.step(0.1)
open("ready", "w").write(repr(float(slave.get()[0])))
time.sleep(60)
"""


def until(reached, seconds=60.0):
    """Wait for something; its value."""
    deadline = time.monotonic() + seconds
    while not (found := reached()):
        assert time.monotonic() < deadline, "it did not come"
        time.sleep(0.02)
    return found


def gone(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


@pytest.fixture(scope="module")
def talking(tmp_path_factory):
    """The FMU of a model that prints, and keeps a temporary file open."""
    folder = tmp_path_factory.mktemp("talking")
    (folder / "talking_model.py").write_text(TALKING)
    sys.path.append(str(folder))
    try:
        return write_hosted_class(__import__("talking_model").Talking, {}, folder / "talking.fmu", 2, "talking")
    finally:
        sys.path.remove(str(folder))


@pytest.mark.parametrize("closed", [(2,), (0, 1, 2)])
def test_a_hosted_fmu_ends_with_an_importer_that_has_no_standard_streams(talking, tmp_path, closed):
    """`socketpair` gave the importer descriptor 2 then, and the host a copy of it: it waited for itself."""
    root = str(Path(__file__).resolve().parents[2])
    program = STEPPING.format(root=root, closed=closed, path=str(talking), folder=str(tmp_path / "x"))
    (tmp_path / "tmp").mkdir()
    environment = {**os.environ, "TMPDIR": str(tmp_path / "tmp"), "SNARELAB_KILLS": f"orphan-{os.getpid()}-{closed}"}
    importer = subprocess.Popen([sys.executable, "-c", program], cwd=tmp_path, env=environment)
    host = int(float(until(lambda: (tmp_path / "ready").exists() and (tmp_path / "ready").read_text())))
    assert list((tmp_path / "tmp").glob("snarelab-process-*/model-file"))
    importer.kill()
    importer.wait()
    until(lambda: gone(host) and not alive(environment["SNARELAB_KILLS"]), 10.0)
    until(lambda: not list((tmp_path / "tmp").iterdir()), 5.0)


def children():
    """Processes that this one has started and that still are."""
    return {int(n) for n in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()}


@pytest.mark.parametrize("version", [2, 3])
def test_ctrl_c_is_the_importers_and_reset_revives(tmp_path, version):
    """The signal of a terminal goes to the whole process group; this process handles it."""
    write_hosted("left_oscillator", tmp_path / "x.fmu", version)
    logged = []
    others = children()  # of tests before this one: a test that failed keeps its FMU until pytest ends
    slave = Slave(tmp_path / "x.fmu", tmp_path / "x", {"force": 1.0}, logged=logged)
    (warden,) = [c for c in children() - others if "host.py" in Path(f"/proc/{c}/cmdline").read_text()]
    before = signal.signal(signal.SIGINT, lambda *_: None)
    try:
        assert os.getpgid(warden) != os.getpgid(0)  # what killpg does, without the other tests' processes
        os.kill(os.getpid(), signal.SIGINT)
        slave.step(0.1)
    finally:
        signal.signal(signal.SIGINT, before)
    wanted = slave.get().tobytes()
    os.kill(warden, signal.SIGKILL)
    until(lambda: gone(warden))
    with pytest.raises(Exception, match=r"status 3|error"):
        slave.step(0.1)
    slave.fmu.reset()
    if version == 2:
        slave.fmu.setupExperiment(startTime=0.0)
    slave.fmu.enterInitializationMode()
    slave.set({"force": 1.0})
    slave.fmu.exitInitializationMode()
    slave.time = 0.0
    slave.step(0.1)
    assert slave.get().tobytes() == wanted
    slave.close()


def test_a_host_is_in_a_session_of_its_own_before_its_python_runs(talking, tmp_path, monkeypatch):
    """Ctrl-C while it starts would end it else: a wrapper of the interpreter notes process, group and session."""
    wrapper, noted = tmp_path / "python", tmp_path / "noted"
    wrapper.write_text(f"#!/bin/sh\ncut -d' ' -f1,5,6 /proc/$$/stat > {noted}\nexec {sys.executable} \"$@\"\n")
    wrapper.chmod(0o755)
    monkeypatch.setenv("SNARELAB_PYTHON", str(wrapper))
    Slave(talking, tmp_path / "x", {"u": 1.0}).close()
    process, group, session = noted.read_text().split()
    assert process == group == session


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    return build(tmp_path_factory.mktemp("hostile"), "left", 2, defined=("HOSTILE",))


@pytest.fixture
def mark(monkeypatch, request):
    """What stands in the environment of processes that a test starts."""
    scratch_folder("test-")  # whose sweeper is this process's, not the test's
    monkeypatch.setenv("SNARELAB_KILLS", f"{request.node.name}-{os.getpid()}")
    return os.environ["SNARELAB_KILLS"]


def started(mark):
    """Processes that this test has started: warden and worker, and what an FMU has."""
    return [process for process in alive(mark) if process != os.getpid() and not gone(process)]


def test_a_crash_is_told_as_it_was_though_a_child_lives_on_and_the_child_ends(hostile, mark):
    left = OwnProcess(Fmu, hostile, timeout=20.0)
    left.initialize(0.0, {"fault": FORK_AND_CRASH, "fault_time": 0.0})
    begun = time.monotonic()
    with pytest.raises(StepError, match=r"left2: its process was killed by SIGSEGV in the step from 0 s"):
        left.step(0.0, 0.01)
    assert time.monotonic() - begun < 15.0  # not the 20 s that nobody answers
    assert not started(mark)


def test_a_daemon_of_an_fmu_ends_with_its_run(hostile, mark):
    """It has left its parent and its session, and is deaf to signals."""
    left = OwnProcess(Fmu, hostile)
    left.initialize(0.0, {"fault": DAEMON, "fault_time": 0.0})
    left.step(0.0, 0.01)
    assert np.isfinite(left.outputs()).all()
    until(lambda: len(started(mark)) > 2)
    left.close()
    assert not started(mark)


def test_an_fmu_that_hangs_at_its_start_or_end_is_not_waited_for_long(hostile, mark):
    left = OwnProcess(Fmu, hostile, timeout=0.5)
    begun = time.monotonic()
    with pytest.raises(StepError, match="gave no answer for 3 s at its start"):
        left.initialize(0.0, {"fault": START_HANG})
    assert time.monotonic() - begun < 8.0
    right = OwnProcess(Fmu, hostile, timeout=0.5)
    right.initialize(0.0, {"fault": END_HANG})
    right.close()
    assert not started(mark)


RUN = """
step = 1e-3
stop = 1000.0
[participants.left]
fmu = "left2.fmu"
parameters = {{ fault = 2, fault_time = {fault_time} }}
[participants.right]
fmu = "right2.fmu"
[connections]
"left.force" = "right.force"
"right.x_left" = "left.x"
"right.v_left" = "left.v"
"""


@pytest.mark.parametrize(
    ("fault_time", "more"),
    [(20.0, []), (0.002, []), (20.0, ["--same-process"])],
    ids=["steps", "hangs", "same-process"],
)
def test_a_killed_run_leaves_its_rows_and_nothing_else(halves, tmp_path, fault_time, more):
    """The FMU hangs at 20 s, after the first report on any machine, or at once; the kill comes as it steps, or then."""
    system = tmp_path / "system.toml"
    system.write_text(RUN.format(fault_time=fault_time).replace('fmu = "', f'fmu = "{halves}/'))
    hangs = fault_time < 1.0
    (tmp_path / "tmp").mkdir()
    mark = f"run-{os.getpid()}-{fault_time}-{len(more)}"
    environment = {**os.environ, "TMPDIR": str(tmp_path / "tmp"), "SNARELAB_KILLS": mark}
    command = [sys.executable, "-m", "snarelab.cli", "cosim", str(system), "--out", "run.csv", *more]
    run = subprocess.Popen(command, cwd=tmp_path, env=environment, start_new_session=True)
    rows = tmp_path / "unfinished-run.csv"
    until(rows.exists)
    if hangs:
        time.sleep(2.0)  # the journal stands at the first step; the third one hangs
    elif not more:  # the loop in C comes to the hanging step before it reports
        until(lambda: rows.stat().st_size > 200)
    assert list((tmp_path / "tmp").iterdir())
    run.kill()
    run.wait()
    until(lambda: not alive(environment["SNARELAB_KILLS"]), 10.0)
    until(lambda: not list((tmp_path / "tmp").iterdir()), 5.0)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["system.toml", "tmp", "unfinished-run.csv"]
    table = pd.read_csv(rows)
    assert {"time", "left.x [m]", "right.force [N]"} <= set(table)
    assert more or hangs or (len(table) > 1 and table["time"].is_monotonic_increasing)


def test_temporary_folders_are_gone_with_a_killed_process(tmp_path):
    program = f"from {scratch_folder.__module__} import scratch_folder; import time\n"
    program += "print(scratch_folder('a-'), scratch_folder('b-'), flush=True)\ntime.sleep(60)"
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    process = subprocess.Popen([sys.executable, "-c", program], env=environment, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    places = process.stdout.readline().split()
    assert all(Path(place).is_dir() for place in places)
    assert len(places) == 2
    process.kill()
    process.wait()
    process.stdout.close()
    until(lambda: not list(tmp_path.iterdir()), 5.0)


def test_kills_of_importers_at_random_moments():
    done = kill_all(["c"], Importer, 3, seed=3)  # of all kinds: bench/importer_kills.py
    assert done["c"].total() == 3
