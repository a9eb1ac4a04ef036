"""The count of kills: what is left behind is harm, every kill is on disk, and a count that was stopped goes on."""

import json
import os
import sys
from pathlib import Path
from typing import ClassVar

import pytest

from bench import killed
from bench.killed import Lost, begin, kill_all, rows_left, settle


class Numbers:
    """Draws one number a kill; the third harms."""

    drawn: ClassVar[list[tuple[str, float]]] = []

    def __init__(self, kind, folder):
        assert not list(folder.iterdir())
        self.kind = kind

    def kill(self, moments):
        self.drawn.append((self.kind, moments.random()))
        if len(self.drawn) == 3:
            raise Lost("the third left a file")
        return {"outcome": "killed"}

    def finish(self):
        pass


def test_a_count_that_was_stopped_goes_on_and_tells_all_harm(tmp_path, monkeypatch):
    monkeypatch.setattr(Numbers, "drawn", [])
    log = tmp_path / "build" / "kills.jsonl"
    with pytest.raises(Lost, match="1 of 5 kills did harm: the third left a file"):
        kill_all(["a", "b"], Numbers, 5, 1, log)
    whole, lines = list(Numbers.drawn), log.read_text().splitlines()
    assert [(kind, number) for kind, number, _ in map(named, lines)] == [
        ("a", 0),
        ("a", 1),
        ("a", 2),
        ("b", 0),
        ("b", 1),
    ]
    assert len({number for _, number in whole}) == 5
    log.write_text("\n".join(lines[:2]) + "\n")
    Numbers.drawn.clear()
    done = kill_all(["a", "b"], Numbers, 4, 1, log)
    assert Numbers.drawn == whole[3:]  # "a" had its two; "b" draws what it would have drawn
    assert {kind: dict(found) for kind, found in done.items()} == {"a": {"killed": 2}, "b": {"killed": 2}}
    Numbers.drawn.clear()
    monkeypatch.setattr(killed, "_sources", lambda: "another program")
    kill_all(["a"], Numbers, 2, 1, log)
    assert len(Numbers.drawn) == 2


def named(line):
    found = json.loads(line)
    return found["kind"], found["number"], found["outcome"]


@pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")
def test_a_process_or_a_file_that_is_left_is_harm(tmp_path, monkeypatch):
    monkeypatch.setattr(killed, "ORPHANS", 0.5)
    script = (
        "import subprocess, sys; print(subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)']).pid)"
    )
    with (tmp_path / "log").open("w") as log:
        process, mark = begin([sys.executable, "-c", script], tmp_path, log)
    assert process.wait() == 0
    child = (tmp_path / "log").read_text().strip()
    with pytest.raises(Lost, match=rf"x: \['{child}'\] 0.5 s after the end"):
        settle("x", mark, tmp_path / "tmp")
    os.kill(int(child), 9)
    assert settle("x", mark, tmp_path / "tmp") < 0.5
    (tmp_path / "tmp" / "folder").mkdir()
    with pytest.raises(Lost, match="tmp/folder"):
        settle("x", mark, tmp_path / "tmp")


@pytest.mark.parametrize(
    ("text", "log", "problem"),
    [
        ("time,x\n0.0,1.0\n0.1,2.0\n", "0.100 s of 1.000 s", None),
        ("time,x\n0.0,1.0\n0.1,2.", "", None),  # the last line of a machine that fell is not whole, and not counted
        ("time,x\n0.0,1.0\n0.1\n", "", "cannot be read"),
        ("time,x\n0.1,1.0\n0.0,2.0\n", "", "cannot be read"),
        ("time,x\n0.0,1.0\n", "0.100 s of 1.000 s", "0.100 s was reported, and rows end at 0.0 s"),
        ("", "0.100 s of 1.000 s", "rows end at None"),
    ],
)
def test_rows_that_were_told_must_be_there_and_whole(tmp_path: Path, text, log, problem):
    (tmp_path / "unfinished-rows.csv").write_text(text)
    if problem is None:
        assert rows_left("x", tmp_path / "rows.csv", log) == text.count("\n") - 1
    else:
        with pytest.raises(Lost, match=problem):
            rows_left("x", tmp_path / "rows.csv", log)
