"""The map over friction and stiffness of passive joints goes on where it stopped, and knows which cells are its own."""

import dataclasses

import pytest

from snarelab.studies.orbit import map as orbit_map
from snarelab.studies.orbit.map import LEVELS, STIFFNESSES, Cell, resistance_map
from snarelab.studies.orbit.setting import SNARE, setting

CELLS = [(level, stiffness) for level in LEVELS for stiffness in STIFFNESSES]


@pytest.fixture
def run(tmp_path, monkeypatch):
    """The cells that were run; the sixth run of all is broken off."""
    monkeypatch.chdir(tmp_path)
    captured = []

    def cell(start, snare, level, stiffness):
        captured.append((level, stiffness))
        if len(captured) == 6:
            raise KeyboardInterrupt
        return Cell(level, stiffness, 2.5, 1e-3 * level, snare.ring_rate, stiffness)

    monkeypatch.setattr(orbit_map, "_cell", cell)
    return captured


def cells(start=None, snare=SNARE):
    return resistance_map(start or setting("inspection"), snare, "demo", lambda _: None)


def test_a_map_that_was_broken_off_repeats_no_cell(run):
    with pytest.raises(KeyboardInterrupt):
        cells()
    assert run == CELLS[:6]
    found = cells()
    assert run == CELLS[:6] + CELLS[5:]
    assert cells() == found  # from files only
    assert len(run) == len(CELLS) + 1
    assert [(c.level, c.stiffness) for c in found] == CELLS
    assert all(c.final_y == 1e-3 * c.level and c.peak_force == c.stiffness for c in found)


@pytest.mark.parametrize("change", ["case", "snare", "source"])
def test_cells_of_another_setting_or_model_are_not_taken(run, monkeypatch, change):
    run.extend([(0.0, 0.0)] * 6)  # nothing is broken off
    first = cells()
    faster = dataclasses.replace(SNARE, ring_rate=2 * SNARE.ring_rate) if change == "snare" else SNARE
    if change == "source":
        monkeypatch.setattr(orbit_map, "source_version", lambda *_: "another text")
    second = cells(setting("hover") if change == "case" else None, faster)
    assert run[6:] == 2 * CELLS
    assert (second == first) == (change != "snare")
    assert cells() == (second if change == "source" else first)
    assert len(run) == 6 + 2 * len(CELLS)
