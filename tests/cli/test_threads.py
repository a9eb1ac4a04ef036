"""One thread of the linear algebra library for a diagnosis, unless the caller says how many."""

import os

import pytest

from snarelab.cli import main
from snarelab.threads import VARIABLES


@pytest.mark.parametrize("command", ["check", "identify", "diagnose"])
def test_small_matrices_get_one_thread_unless_told(command, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(VARIABLES[0], "3")
    for name in VARIABLES[1:]:
        monkeypatch.delenv(name, raising=False)
    more = ["--holdout", "b.csv"] if command == "diagnose" else []
    assert main([command, "none.toml", "a.csv", *more]) == 2
    assert "none.toml" in capsys.readouterr().err
    assert [os.environ[name] for name in VARIABLES] == ["3", "1", "1"]
    for name in VARIABLES[1:]:
        del os.environ[name]
