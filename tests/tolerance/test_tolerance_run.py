"""Runs of a tolerance study: killed, continued, on one worker or several, on a scheduler of its own process."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import distributed  # noqa: F401 (brings the defaults that its configuration is changed from)
import pandas as pd
import pytest
from dask import config as dask_config

from snarelab.tolerance import run
from snarelab.tolerance.capture import Axis, Capture, Outcome
from snarelab.tolerance.results import Results
from snarelab.tolerance.study import Study, Success

TOY = """
import os, time
from pathlib import Path
import numpy as np
from snarelab.tolerance.capture import Axis, Capture, Outcome

def run(values):
    time.sleep(float(os.environ.get("CASE_SECONDS", "0")))
    y, z = values["radial_y"], values["radial_z"]
    once = os.environ.get("DIE_ONCE")
    if once and 0.05 < y < 0.09 and not Path(once).exists():
        Path(once).touch()
        os.kill(os.getpid(), 9)
    if os.environ.get("DIE_ALWAYS") and y > 0.09:
        os.kill(os.getpid(), 9)
    if z > 0.09:
        raise ArithmeticError("the step diverged at 1.2 s")
    error = np.hypot(y, z) / 6
    return Outcome(bool(error < 0.02), error, 2.6, 5.0, 100.0)

CAPTURE = Capture("toy", tuple(Axis(n, "m", n, 0.0, -1.0, 1.0) for n in ("radial_y", "radial_z")), run)
"""

STUDY = """
capture = "toy_capture:CAPTURE"
seed = 3
sampling = "{sampling}"
batch = 8
cases = 40
width = 0.001
[ranges]
radial_y = [-0.1, 0.1]
radial_z = [-0.1, 0.1]
[success]
radial_error = 0.01
strength = 800.0
"""


SLOW = partial(lambda values, outcome: (time.sleep(0.2), outcome)[1], outcome=Outcome(True, 0.0, 1.0, 1.0, 1.0))


@pytest.fixture
def command(tmp_path: Path):
    (tmp_path / "toy_capture.py").write_text(TOY)

    def start(out: str, *extra: str, sampling: str = "adaptive", **environment: str) -> subprocess.Popen:
        study = tmp_path / f"{sampling}.toml"
        study.write_text(STUDY.format(sampling=sampling))
        path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
        return subprocess.Popen(
            [sys.executable, "-m", "snarelab.cli", "tolerance", study, "--out", tmp_path / out, *extra],
            env={**os.environ, "PYTHONPATH": path, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1", **environment},
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    return start


def finish(process: subprocess.Popen, status: int = 0) -> str:
    try:
        out, error = process.communicate(timeout=240)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        raise
    assert process.returncode == status, error
    return out + error


def recorded(folder: Path) -> int:
    files = [pd.read_parquet(p) for p in folder.glob("*.parquet")]
    return len(pd.concat(files)[["stage", "case"]].drop_duplicates()) if files else 0


@pytest.mark.slow
def test_five_kills_leave_the_same_table(command, tmp_path):
    moments, folder = random.Random(7), tmp_path / "killed" / "cases"
    finish(command("alone", "--jobs", "1"))
    before = 0
    for _ in range(5):  # many more: bench/kills.py
        process = command("killed", "--jobs", moments.choice("12"), CASE_SECONDS="0.05")
        files = set(folder.glob("*.parquet"))
        begun, more = time.monotonic(), moments.randint(0, 4)
        while process.poll() is None and len(set(folder.glob("*.parquet")) - files) < more:
            assert time.monotonic() < begun + 60
            time.sleep(0.01)
        time.sleep(moments.uniform(0.0, 0.1))
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        after = recorded(folder)
        assert after >= before
        before = after
    assert before > 0
    finish(command("killed", "--jobs", "2"))
    alone, killed = (pd.read_parquet(tmp_path / name / "cases.parquet") for name in ("alone", "killed"))
    pd.testing.assert_frame_equal(alone, killed, check_exact=True)


@pytest.mark.slow
def test_a_lost_worker_costs_its_case_only(command, tmp_path):
    finish(command("well", "--jobs", "2", sampling="sobol"))
    finish(command("ill", "--jobs", "2", sampling="sobol", DIE_ONCE=str(tmp_path / "died"), DIE_ALWAYS="1"))
    assert (tmp_path / "died").exists()  # with a case that is there all the same
    well, ill = (pd.read_parquet(tmp_path / name / "cases.parquet") for name in ("well", "ill"))
    lost = ill["reason"].str.contains("worker was killed").to_numpy()
    assert lost.any()
    assert (ill["radial_y"].to_numpy()[lost] > 0.09).all()
    pd.testing.assert_frame_equal(well.iloc[~lost], ill.iloc[~lost], check_exact=True)


def test_a_worker_that_is_gone_for_good_is_replaced(tmp_path, monkeypatch):
    """Dask gives up on a worker whose restart fails; nothing would ever come back from it."""
    monkeypatch.setattr(run, "WATCH", 0.5)
    axes = (Axis("radial_y", "m", "", 0.0, -1.0, 1.0),)
    success, ranges = Success(0.01, 800.0), {"radial_y": (-0.1, 0.1)}
    slow = Capture("slow", axes, SLOW)
    study = Study(tmp_path, "slow", slow, 1, "sobol", 4, 4, 0.1, ranges, {}, success, {}, 1)
    results = Results(tmp_path / "out", study)
    with dask_config.set({"distributed.deploy.lost-worker-timeout": "100ms"}), run.local_cluster(1) as cluster:
        lost: Any = cluster.workers[0]

        def lose(text: str) -> None:
            if len(results) == 1:
                cluster.sync(lost.close)

        monkeypatch.setattr(run, "local_cluster", lambda jobs: nullcontext(cluster))
        run.run_study(study, results, jobs=1, say=lose)
    assert len(results.table("space")) == 4


def test_a_case_that_diverges_is_an_outcome(command, tmp_path):
    finish(command("out", "--jobs", "1", sampling="latin_hypercube"))
    table = pd.read_parquet(tmp_path / "out" / "cases.parquet")
    diverged = table["radial_z"].to_numpy() > 0.09
    assert set(table["reason"].to_numpy()[diverged]) == {"the step diverged at 1.2 s"}
    assert set(table["margin"].to_numpy()[diverged]) == {-1.0}
    assert set(table["reason"].to_numpy()[~diverged]) == {""}


@pytest.mark.slow
def test_scheduler_and_workers_of_their_own(command, tmp_path):
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    address_file = tmp_path / "scheduler.json"
    environment = {**os.environ, "PYTHONPATH": path}
    options = ["--scheduler-file", str(address_file)]
    servers = [
        subprocess.Popen(
            [
                *(sys.executable, "-m"),
                "distributed.cli.dask_scheduler",
                "--host",
                "127.0.0.1",
                "--port",
                "0",
                "--no-dashboard",
                *options,
            ],
            env=environment,
            cwd=tmp_path,
            stderr=subprocess.DEVNULL,
        )
    ]
    try:
        begun = time.monotonic()
        while not address_file.exists() and time.monotonic() < begun + 60:
            time.sleep(0.05)
        servers += [
            subprocess.Popen(
                [*(sys.executable, "-m"), "distributed.cli.dask_worker", "--nthreads", "1", "--no-dashboard", *options],
                env=environment,
                cwd=tmp_path,
                stderr=subprocess.DEVNULL,
            )
            for _ in range(2)
        ]
        finish(command("remote", "--scheduler", json.loads(address_file.read_text())["address"]))
        finish(command("local", "--jobs", "1"))
    finally:
        for server in servers:
            server.kill()  # they hold nothing
            server.wait(30)
    remote, local = (pd.read_parquet(tmp_path / name / "cases.parquet") for name in ("remote", "local"))
    pd.testing.assert_frame_equal(remote, local, check_exact=True)


def test_unreachable_scheduler(command, tmp_path):
    message = finish(command("out", "--scheduler", "tcp://127.0.0.1:1"), status=2)
    assert "scheduler 'tcp://127.0.0.1:1' cannot be reached" in message
    assert not (tmp_path / "out").exists()
    assert message.count("\n") == 1
