"""What a study leaves for scripts is JSON even where the recordings leave a value open."""

import json

from snarelab.studies.outcome import Quantity, interval, table, write_result


def test_a_value_left_open_has_no_interval(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = [Quantity("mass", "kg", 2.0, "predicted", 1.9, *interval(2.0, std)) for std in (0.25, float("inf"))]
    written = json.loads(write_result("any", found, 1.0).read_text())["quantities"]
    assert [(q["low"], q["high"]) for q in written] == [(1.5, 2.5), (None, None)]
    assert "1.5 to 2.5" in table(found[:1])
    assert " to " not in table(found[1:])
