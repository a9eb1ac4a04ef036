"""Captures simulated side by side: the same as in one process, none twice, and processes that die are replaced."""

from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest
from captures_by_hand import known

from snarelab.identification.snare.runs import MOST_LOST, CaptureRuns
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.setup import CaptureSetup
from snarelab.models.snare.target import Target

STILL = (0.0, 0.0, 0.0)
ASKED = [
    (0, {"umbilical_stiffness.target.stiffness": 2.0}, STILL),
    (1, {}, STILL),
    (0, {"umbilical_stiffness.target.stiffness": 2.0}, STILL),
]


class Held:
    """As much of a capture as is simulated: a quarter of a second of it."""

    def __init__(self, mass):
        self.setup = CaptureSetup(SnareParameters(), Target("pendulum", mass=mass))
        self.start = known(self.setup)
        self.drive = None
        self.times = np.arange(6)


CAPTURES: Any = [Held(12.0), Held(25.0)]


def positions(tracks):
    assert all(t is not None for t in tracks)
    return np.stack([t.position for t in tracks])


@pytest.mark.slow
def test_processes_give_what_one_gives_and_replace_one_that_died():
    with CaptureRuns(CAPTURES, workers=1) as alone:
        expected = positions(alone(ASKED))
        assert alone.count == 2  # the first and the last are one
        alone(ASKED)
        assert alone.count == 2
    with CaptureRuns(CAPTURES, workers=2) as runs:
        np.testing.assert_array_equal(positions(runs(ASKED)), expected)
        assert runs.count == 2
        pool = runs._pool
        assert pool is not None
        for process in pool._processes.values():
            process.kill()
        more = [(n, {**values, "contact_friction.pin.coefficient": 0.2}, x) for n, values, x in ASKED]
        np.testing.assert_array_equal(positions(runs(more)), expected)  # out of the cables' reach nothing rubs
        assert runs._pool is not pool
        assert runs.count == 4


def test_processes_that_keep_dying_are_not_replaced_for_ever(monkeypatch):
    tried = []

    def dies(_self, keys):
        tried.append(len(keys))
        raise BrokenProcessPool

    monkeypatch.setattr(CaptureRuns, "_share_out", dies)
    with CaptureRuns(CAPTURES, workers=2) as runs, pytest.raises(BrokenProcessPool):
        runs(ASKED)
    assert tried == [2] * (MOST_LOST + 1)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="processes are looked up in /proc")
def test_an_interrupt_ends_the_processes_at_once():
    runs = CaptureRuns(CAPTURES, workers=2)
    runs(ASKED)
    assert runs._pool is not None
    numbers = list(runs._pool._processes)
    with pytest.raises(KeyboardInterrupt), runs:
        raise KeyboardInterrupt
    until = monotonic() + 20.0
    while monotonic() < until and any(Path(f"/proc/{n}").exists() for n in numbers):
        sleep(0.05)
    assert not [n for n in numbers if Path(f"/proc/{n}").exists()]
