"""Captures do what they did: numbers of `tolerances.toml` found again, each within what is allowed.

Where one has moved, the message says what it was, what it is, and what is allowed. If the move was meant, renew the
file: ``python -m snarelab.tolerance.renew``.
"""

import math
from pathlib import Path

import pytest

from snarelab.errors import InputError
from snarelab.tolerance import renew
from snarelab.tolerance.guard import (
    FARTHEST,
    GuardedNumber,
    arrival_numbers,
    end_holds,
    envelope_end,
    ground_numbers,
    halved,
    latched_numbers,
    load,
    moved,
)
from snarelab.tolerance.renew import rewritten

FILE = Path(__file__).parents[1] / "tolerances.toml"
GUARDED = load(FILE)
RENEW = "if this was meant: python -m snarelab.tolerance.renew"


def check(section, after):
    found = moved(section, GUARDED[section], after)
    assert not found, "\n".join([*map(str, found), RENEW])


@pytest.mark.slow
def test_the_papers_ground_capture():
    check("ground", ground_numbers())


@pytest.mark.parametrize("axis", FARTHEST)
def test_envelope_of_an_axis(axis):
    end = GUARDED["envelope"][axis]
    if not end_holds(axis, end):  # where it has gone to is worth the time only then
        check("envelope", {**{a: e.value for a, e in GUARDED["envelope"].items()}, axis: envelope_end(axis, 1e-3)})
        pytest.fail(f"envelope.{axis} has more than one end by now; look at the captures around {end.value:g}")


@pytest.mark.slow
def test_the_papers_arrival_in_orbit():
    check("arrival", arrival_numbers())


@pytest.mark.slow
def test_the_papers_hover_capture_to_the_latch():
    check("latched", latched_numbers())


def test_a_number_that_moved_is_told_with_before_after_and_allowed():
    before = {"peak_force": GuardedNumber(20.0, 1.0, "N"), "first_contact": GuardedNumber(2.6, 0.1, "s")}
    assert not moved("x", before, {"peak_force": 20.9, "first_contact": 2.5001})
    (force,) = moved("x", before, {"peak_force": 21.5, "first_contact": 2.6})
    assert str(force) == "x.peak_force: was 20 N, is 21.5, allowed is a change of 1"
    assert len(moved("x", before, {"peak_force": 20.0, "first_contact": math.nan})) == 1


def test_halving_finds_the_end():
    assert halved(lambda x: x < 0.0173, 0.08, 1e-4) == pytest.approx(0.0173, abs=1e-4)
    assert halved(lambda x: True, 0.08, 1e-4) == 0.08
    assert halved(lambda x: False, 0.08, 1e-4) == 0.0


def test_renewing_changes_values_only(tmp_path):
    text = FILE.read_text(encoding="utf-8")
    after = {section: {name: 2 * g.value for name, g in rows.items()} for section, rows in GUARDED.items()}
    new = tmp_path / "new.toml"
    new.write_text(rewritten(text, after), encoding="utf-8")
    for section, rows in load(new).items():
        for name, guarded in rows.items():
            assert guarded.value == pytest.approx(2 * GUARDED[section][name].value, rel=1e-5)
            assert guarded.allowed == GUARDED[section][name].allowed
    same = {section: {name: g.value for name, g in rows.items()} for section, rows in GUARDED.items()}
    assert load(FILE) == GUARDED
    assert [line.partition("value")[0] for line in rewritten(text, same).splitlines()] == [
        line.partition("value")[0] for line in text.splitlines()
    ]


def test_renewing_says_what_moved_and_writes_it(tmp_path, monkeypatch, capsys):
    """Measured by stand-ins, as the measurements take minutes: they are tests of their own."""
    text = (
        '[ground]\nfirst_contact = { value = 2.6, allowed = 0.01, unit = "s" } # seen\n'
        '[envelope]\nradial_y = { value = 0.014, allowed = 0.004, unit = "m" }\n'
        '[arrival]\nfirst_contact = { value = 7.0, allowed = 0.03, unit = "s" }\n'
        '[latched]\nlatched = { value = 0.48, allowed = 0.05, unit = "1" }\n'
    )
    (tmp_path / "t.toml").write_text(text)
    exact = []
    monkeypatch.setattr(renew, "FARTHEST", {"radial_y": 0.08})
    monkeypatch.setattr(renew, "envelope_end", lambda axis, to: exact.append((axis, to)) or 0.015)
    monkeypatch.setattr(renew, "ground_numbers", lambda: {"first_contact": 2.625})
    monkeypatch.setattr(renew, "arrival_numbers", lambda: {"first_contact": 7.1})
    monkeypatch.setattr(renew, "latched_numbers", lambda: {"latched": 0.47})
    assert renew.main([str(tmp_path / "t.toml")]) == 0
    assert exact == [("radial_y", 0.001)]
    changed = (
        text.replace("2.6,", "2.625,").replace("0.014,", "0.015,").replace("7.0,", "7.1,").replace("0.48,", "0.47,")
    )
    assert (tmp_path / "t.toml").read_text() == changed
    assert [file.name for file in tmp_path.iterdir()] == ["t.toml"]
    said = capsys.readouterr().out.splitlines()
    assert said[0].split() == ["ground.first_contact", "2.6", "->", "2.625", "s"]
    assert renew.main([str(tmp_path / "none.toml")]) == 2
    assert "cannot be read" in capsys.readouterr().err


def test_a_file_without_an_allowed_change_is_refused(tmp_path):
    path = tmp_path / "t.toml"
    path.write_text("[ground]\nfirst_contact = { value = 2.6 }\n")
    with pytest.raises(InputError, match=r"each number needs value, allowed and unit \('allowed'\)"):
        load(path)
