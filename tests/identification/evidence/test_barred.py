"""Names that the held-out recordings contradict are barred first; names that they only do not confirm, if none is."""

from types import SimpleNamespace

import pytest

from snarelab.identification.evidence.barred import barred


@pytest.mark.parametrize(
    ("gains", "out"),
    [
        ({}, set()),
        ({"ripple": -220.0, "drift": -18.7, "groove": 39.3}, {"ripple", "drift"}),
        ({"drift": 12.0, "groove": 39.3}, {"drift", "groove"}),
        ({"groove": 0.0}, {"groove"}),
    ],
)
def test_what_held_out_recordings_contradict_is_barred_first(gains, out):
    names = [SimpleNamespace(placed=SimpleNamespace(key=key)) for key in gains]
    made = barred(names, {key: SimpleNamespace(gain=gain) for key, gain in gains.items()})
    assert set(made) == out
    assert all(made[n.placed.key] is n for n in names if n.placed.key in out)
