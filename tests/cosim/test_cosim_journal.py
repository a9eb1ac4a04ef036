"""A run on disk as it goes: rows before they are reported, the recording whole, and two runs of one name kept apart."""

import ast
import errno
from pathlib import Path

import pandas as pd
import pytest

import snarelab.cosim
from snarelab.cosim.journal import Journal, unfinished
from snarelab.cosim.master import Master
from snarelab.cosim.participants.oscillator import LeftOscillator, RightOscillator
from snarelab.cosim.system import PowerBond, System
from snarelab.errors import InputError
from snarelab.recordings import write_recording

LINKS = [("right.force", "left.force"), ("left.x", "right.x_left"), ("left.v", "right.v_left")]


def master():
    bonds = [PowerBond("spring", "right.force", "left.v")]
    return Master(System({"left": LeftOscillator(), "right": RightOscillator()}, LINKS, bonds=bonds), 1e-2)


@pytest.mark.parametrize("name", ["run.csv", "run.parquet"])
def test_what_is_reported_is_on_the_disk(tmp_path, name):
    one, seen = master(), []
    rows = unfinished(tmp_path / name)
    assert rows.parent == tmp_path
    assert not rows.match("run.*")
    with Journal(one.record, tmp_path / name, often=0.0) as journal:

        def say(now):
            table = pd.read_csv(rows)
            assert table["time"].iloc[-1] == now
            assert rows.read_text().endswith("\n")
            seen.append(now)

        run = one.run(0.1, journal.report(say))
        assert len(seen) == 10
        assert not (tmp_path / name).exists()
        journal.finish()
    assert [p.name for p in tmp_path.iterdir()] == [name]
    write_recording(run.recording, tmp_path / f"whole-{name}")
    assert (tmp_path / name).read_bytes() == (tmp_path / f"whole-{name}").read_bytes()


def test_reports_are_rare(tmp_path):
    one, seen = master(), []
    with Journal(one.record, tmp_path / "run.csv", often=60.0) as journal:
        one.run(1.0, journal.report(seen.append))
        assert not seen
        journal.discard()
    assert not list(tmp_path.iterdir())


def test_a_run_that_is_dropped_leaves_its_rows_and_the_next_one_begins_anew(tmp_path):
    one = master()
    with Journal(one.record, tmp_path / "run.csv") as journal:
        one.run(0.05)
        journal.write()
    assert len(pd.read_csv(tmp_path / "unfinished-run.csv")) == 6
    with Journal(master().record, tmp_path / "run.csv") as journal:
        assert len(pd.read_csv(tmp_path / "unfinished-run.csv")) == 0
        with pytest.raises(InputError, match="another run is writing it"):
            Journal(one.record, tmp_path / "run.csv")
        journal.finish()
    assert len(pd.read_csv(tmp_path / "run.csv")) == 1
    assert not (tmp_path / "unfinished-run.csv").exists()


def test_a_full_disk_is_told_and_keeps_what_there_is(tmp_path, monkeypatch):
    one = master()
    with Journal(one.record, tmp_path / "run.csv") as journal:
        one.run(0.05)
        journal.write()

        def full(_):
            raise OSError(errno.ENOSPC, "No space left on device")

        monkeypatch.setattr("os.fsync", full)
        one.run(0.1)
        with pytest.raises(InputError, match=r"unfinished-run\.csv: cannot be written further: No space left"):
            journal.finish()
    assert len(pd.read_csv(tmp_path / "unfinished-run.csv")) >= 6


@pytest.mark.parametrize("name", ["run.txt", "nowhere/run.csv"])
def test_a_place_that_cannot_be_written_is_refused_before_the_run(tmp_path, name):
    with pytest.raises(InputError):
        Journal(master().record, tmp_path / name)


def test_no_part_of_cosim_leads_back_to_itself():
    """What a system is, how a file becomes one, how a participant is started: by every import, also late ones."""
    folder = Path(snarelab.cosim.__file__).parent
    arrows = {}
    for path in folder.glob("*.py"):
        tree = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        named = [node.module for node in tree if isinstance(node, ast.ImportFrom) and node.level == 1 and node.module]
        arrows[path.stem] = {name for name in named if "." not in name}
    assert "experiment" in arrows["ssp"]

    def below(name, seen):
        for other in arrows.get(name, ()):
            assert other not in seen, f"{' -> '.join([*seen, other])} is a circle"
            below(other, [*seen, other])

    for name in arrows:
        below(name, [name])
