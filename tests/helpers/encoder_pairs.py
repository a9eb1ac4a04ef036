"""Two encoders of one joint, without a filter between a sample and the analysis band: numbers that a hand can work."""

from typing import Any

import numpy as np

from snarelab.identification.fitting.experiment import Scales
from snarelab.identification.links.run import EncoderPair
from snarelab.identification.links.source import Links
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.recordings import JointKind
from snarelab.recordings.condition import Motion

RATE = 64.0
"""[Hz] Its period is exact in binary."""

SCALES = Scales(speed=2.0, travel=0.5, torque=8.0)


def placed(name, at, **given):
    return PlacedEffect(get_effect(name), at, **given)


def motion(
    q, difference, qd: Any = None, segments=None, rate=RATE, joints=("joint1",), path="/data/run.csv", start=100.0
):
    """One joint's (n,) or several joints' (n, J) positions, and link less motor position in place of torque."""
    q, tau = (np.asarray(x, float).reshape(len(x), -1) for x in (q, difference))
    speed: Any = np.gradient(q, 1 / rate, axis=0) if qd is None else np.asarray(qd, float).reshape(len(q), -1)
    time = np.asarray(start + np.arange(len(q)) / rate, np.float64)
    parts = tuple(segments or (slice(0, len(q)),))
    none = np.full_like(q, np.nan)
    noise = np.zeros((3, q.shape[1]))
    return Motion(path, joints, 1 / rate, rate / 2, time, q, speed, 0 * q, tau, none, parts, 1, (), noise)


def run(q, difference, load=None, inertia=1.0, joint=0, **given):
    """Loaded by nothing unless said otherwise."""
    made = motion(q, difference, **given)
    n = len(made.time)
    return EncoderPair(made, joint, np.broadcast_to(0.0 if load is None else load, n).copy(), np.full(n, inertia))


def links(*runs, kind: JointKind = "revolute", scales=SCALES, n_train=None):
    """Recordings of one joint, all for training unless said otherwise."""
    return Links(["joint1"], [kind], [scales], [[r] for r in runs], len(runs) if n_train is None else n_train)
