"""What scripts read of a registered run: each generator's figures, the worst of them, the rivals', the limits'."""

import json
from pathlib import Path

import pytest

from proof.bars_table import LEFT_OUT
from proof.drives.table import Figure, figures
from proof.registered_quantities import AT_LEAST, AT_MOST, of_rivals, quantities, result, seen_at_limit

FALSE, PLACE = "clean: a false name", "place right, of names that are told"


def figure(value, low=0.0, high=1.0):
    return {"value": value, "cases": 10, "interval": (low, high)}


def by_name(found):
    return {q.name: q for q in found}


def test_the_plain_name_is_the_worst_generator_with_its_interval():
    found = by_name(
        quantities(
            {
                "drives": {FALSE: figure(0.02, 0.01, 0.05), PLACE: figure(0.97)},
                "played": {FALSE: figure(0.05, 0.02, 0.11), PLACE: figure(0.91, 0.85, 0.95)},
                "mujoco": {FALSE: figure(None), PLACE: figure(None)},
            }
        )
    )
    assert (found["false_alarms"].ours, found["false_alarms"].low, found["false_alarms"].high) == (0.05, 0.02, 0.11)
    assert (found["place"].ours, found["place"].low) == (0.91, 0.85)
    assert found["replay.false_alarms"].ours == 0.05
    assert found["drives.place"].ours == 0.97
    assert found["mujoco.place"].ours == "n/a"
    assert "pairs" not in found
    assert by_name(quantities({"drives": {PLACE: figure(None)}}))["place"].ours == "n/a"


def test_every_figure_is_one_that_is_counted():
    counted = {f.name for f in figures([])} | {LEFT_OUT}
    assert {*AT_MOST.values(), *AT_LEAST.values()} <= counted


def test_rivals_stand_under_their_names_and_the_tool_under_none():
    compared = {"drives": {"snarelab": [Figure(PLACE, 0.9, 4)], "joint_bic": [Figure(PLACE, 0.4, 4, (0.1, 0.8))]}}
    registered = {"date": "2026-01-01", "commit": "0" * 40, "cases": 2, "seeds": {"drives": [500]}, "tool": "1"}
    found = {"registered": registered, "generators": {"drives": {PLACE: figure(0.9)}}}
    whole = result(found, of_rivals(compared), Path("no run"), 1.0)
    ours = {q["name"]: q["ours"] for q in whole["quantities"]}
    assert ours == {
        "drives.place": 0.9,
        "place": 0.9,
        "seen_at_limit": "n/a",
        "joint_bic.drives.place": 0.4,
        "joint_bic.place": 0.4,
    }
    assert (whole["study"], whole["registered"]["seeds"]) == ("proof", {"drives": [500]})


def test_what_was_seen_at_the_limit_is_read_from_the_power_run(tmp_path):
    rows = [{"ratio": r, "cases": 8, "seen": s, "seen_interval": [0.4, 1.0]} for r, s in ((0.8, 0.5), (1.0, 0.875))]
    (tmp_path / "result.json").write_text(json.dumps({"effects": {"all": rows}}))
    found = seen_at_limit(tmp_path)
    assert found.ours == pytest.approx(0.875)
    assert (found.low, found.high) == (0.4, 1.0)
