"""Nameless curves of several recordings: one function of what they run over, whatever part of it each has travelled."""

import numpy as np
from moving_arm import build, motion, placed, three_joints

from snarelab.identification.fitting.experiment import Experiment
from snarelab.identification.search.curves import FINE, LOCAL, nameless_columns


def test_recordings_share_the_knots_of_a_curve(tmp_path):
    """Amplitudes read off a function of position at the common knots give it back on either recording."""
    arm = three_joints(tmp_path)
    kinds = [j.kind for j in arm[0].joints]
    short, long = (Experiment(motion(kinds, n), arm[1]) for n in (150, 1200))
    assert np.ptp(short.motion.q[:, 0]) < 0.7 * np.ptp(long.motion.q[:, 0])
    assembly = build(arm, long, placed(("viscous_friction", "joint1")))
    states = [assembly.evaluate(e, assembly.start) for e in (short, long)]
    curves = nameless_columns([short, long], states, 0)
    both = np.concatenate([e.motion.q[:, 0] for e in (short, long)])
    knots = np.linspace(both.min(), both.max(), FINE)
    places = [parts for words, parts in curves.items() if words.startswith("position near")]
    assert len(places) == (FINE - LOCAL) // (LOCAL // 2) + 1
    # Every second place joins the one before without overlap, so that together they are the whole travel's curve.
    tiles = places[::2]
    n = LOCAL * len(tiles)
    for k, e in enumerate((short, long)):
        q = e.motion.q[:, 0]
        heights = np.where(np.arange(FINE) < n, np.sin(3 * knots), 0.0)
        wanted = e.to_band(np.interp(q, knots, heights)[:, None], 0)[:, 0]
        found = sum(parts[k] @ np.sin(3 * knots[i * LOCAL : (i + 1) * LOCAL]) for i, parts in enumerate(tiles))
        np.testing.assert_allclose(found, wanted, atol=1e-9)
