"""Cases that nobody has seen: each run draws others, and the tool has an answer to each."""

import pytest
from this_commit import number

from proof.benchmark.case_set import GENERATORS
from proof.drives.cases import FAULTY
from proof.drives.judge import judge
from proof.drives.score import score
from proof.played.residuals import RECORDINGS
from proof.played.robots import published


@pytest.mark.slow
@pytest.mark.parametrize("generator", list(GENERATORS))
def test_unseen_cases_are_answered(generator, tmp_path):
    """A failure says which seed; what a case was told is in the captured output. How long it takes is no test of it."""
    if generator == "played" and not (RECORDINGS.exists() and published()):
        pytest.skip("recordings or example-robot-data are not there")
    fresh = 1000 + number()
    folders = GENERATORS[generator](tmp_path / "cases", fresh, 2)
    lines = score(folders, tmp_path / "answers.jsonl", 1200.0)
    for line in lines:
        assert line["verdict"] in ("adequate", "missing_physics", "unknown_effect", "data_fault"), (fresh, line)
        if line["truth"]["group"] != FAULTY:
            assert all(0.0 < t.probability <= 1.0 for t in judge(line).told), fresh
