"""The whole end effector in orbit, from the paper's misalignment to the latch, and a capture that is broken off."""

import dataclasses

import numpy as np
import pytest

from snarelab.cosim.docked import (
    ball_shares,
    docked_of,
    energies,
    is_latched,
    margin,
    mean_wrist,
    momentum_drift,
    preload,
    residual,
)
from snarelab.cosim.state_table import read_table
from snarelab.cosim.whole_capture import co_simulate_whole
from snarelab.models.docking.parameters import PRELOAD_WINDOW, DockingParameters
from snarelab.studies.orbit.setting import setting

P = DockingParameters()


@pytest.fixture(scope="module")
def hover():
    return docked_of(co_simulate_whole(setting("hover")))


@pytest.mark.slow
def test_it_latches_with_all_three_balls_in_their_seats(hover):
    assert hover.whole.fault == ""
    assert is_latched(hover, P) == (True, "LATCHED")
    assert 0 < margin(hover, P) <= 1
    assert ball_shares(hover, P, preload(hover)).min() > 0.9  # friction bears the rest
    assert max(residual(hover)) < 1e-4
    assert PRELOAD_WINDOW[0] < preload(hover) < PRELOAD_WINDOW[1]
    assert mean_wrist(hover)[1].max() < 300.0  # the preload is internal
    states = [state for state, _, _ in hover.whole.phases]
    wanted = ["CLOSE", "SETTLE", "SNUG", "SLIDE", "PULL", "SEAT", "PRELOAD", "LATCH", "LATCHED"]
    assert [state for state in states if state in wanted][-4:] == wanted[-4:]
    assert set(states) <= {*wanted, "BACK_OFF"}


@pytest.mark.slow
def test_momentum_and_energy_are_kept_to_the_latch(hover):
    assert momentum_drift(hover) < 1e-9
    ledger = energies(hover)
    assert ledger["motors"].max() > 30.0
    assert np.abs(ledger["residual"]).max() < 2e-3 * ledger["motors"].max()
    for name in ("lost in screw and carriage", "lost in cables", "lost in joints"):
        assert (np.diff(ledger[name]) > -1e-6).all()


@pytest.mark.slow
def test_what_is_not_seated_does_not_count(hover):
    """The same run, had a ball been empty or the program ended elsewhere."""
    empty = hover.normal.copy()
    empty[-1, :2] = 0.0
    assert is_latched(dataclasses.replace(hover, normal=empty), P) == (False, "a ball bears less than half its share")
    assert margin(dataclasses.replace(hover, normal=empty), P) == -1.0
    out = dataclasses.replace(hover, whole=dataclasses.replace(hover.whole, final="ABORTED"))
    assert is_latched(out, P) == (False, "ABORTED")
    assert margin(out, P) == -1.0


@pytest.mark.slow
@pytest.mark.parametrize("state", ["CLOSE", "SLIDE"])
def test_broken_off_in_a_state_it_ends_a_second_free_of_contact(state):
    """A table whose state gives up after a moment; the rest is the program's own way out."""
    table = read_table()
    after, way_out = (9.0, "OPEN") if state == "CLOSE" else (2.0, "UNLOAD")
    early = dataclasses.replace(table.states[state], leave=(), after=after, timeout=way_out)
    d = docked_of(
        co_simulate_whole(setting("hover"), table=dataclasses.replace(table, states={**table.states, state: early}))
    )
    assert d.whole.fault == ""
    assert d.whole.final == "ABORTED"
    recording = d.whole.run.recording
    touching = sum(
        recording[key].to_numpy() for key in recording.variables if str(key).split(" ")[0].endswith(".touching")
    )
    assert d.times[-1] - d.times[touching > 0].max(initial=0.0) >= 1.0
    assert d.tension.max() < 8000.0
