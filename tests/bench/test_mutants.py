"""Shares of changes that a test noticed, by folder, in the file that two programs fill."""

import json

from bench.mutants import Mutant, killed
from bench.results import leave


def test_a_change_counts_where_a_test_noticed_it():
    ended = {
        Mutant("cosim/a.py", "AddNot", 0, 3): "killed",
        Mutant("cosim/a.py", "AddNot", 1, 4): "survived",
        Mutant("cosim/b.py", "AddNot", 0, 5): "not reached",
        Mutant("cosim/b.py", "AddNot", 1, 6): "killed",
        Mutant("models/a.py", "AddNot", 0, 1): "killed",
    }
    assert killed(ended, ["cosim", "models", "fmu"]) == {"killed.cosim": 0.5, "killed.models": 1.0}


def test_one_file_keeps_what_the_other_program_left(tmp_path):
    leave(tmp_path / "new" / "result.json", {"constants_pinned": 0.5, "branch_coverage": 0.1})
    leave(tmp_path / "new" / "result.json", {"branch_coverage": 0.9})
    assert json.loads((tmp_path / "new" / "result.json").read_text()) == {
        "constants_pinned": 0.5,
        "branch_coverage": 0.9,
    }
