"""A random arm of three joints that moves in sines, with any effects."""

import numpy as np

from bench.arm import random_arm
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.experiment import scales
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.rigid_body import RigidBody
from snarelab.models.urdf import load_urdf
from snarelab.recordings.condition import Motion

PERIOD = 5e-3
JOINTS = ("joint1", "joint2", "joint3")


def placed(*entries):
    """``("viscous_friction", "joint1")`` or with names of held parameters after it."""
    return [PlacedEffect(get_effect(name), at, tuple(hold)) for name, at, *hold in entries]


def motion(kinds, n=1200, segments=None, thinning=3, first=0):
    """Sines of every joint, exact; samples ``first`` to ``first + n`` of one endless motion."""
    t = np.asarray(PERIOD * np.arange(first, first + n), np.float64)
    size = np.array([0.15 if kind == "prismatic" else 0.8 for kind in kinds])
    q, qd, qdd = np.zeros((3, n, len(kinds)))
    for k, (amplitude, frequency) in enumerate([(1.0, 0.37), (0.4, 0.9), (0.1, 2.3)]):
        w = 2 * np.pi * frequency * (1 + 0.13 * np.arange(len(kinds)))
        angle = w * t[:, None] + 0.7 * k + np.arange(len(kinds))
        q += amplitude * size * np.sin(angle)
        qd += amplitude * size * w * np.cos(angle)
        qdd -= amplitude * size * w**2 * np.sin(angle)
    tau = 30.0 * np.cos(t[:, None] + np.arange(len(kinds)))
    return exact(JOINTS[: len(kinds)], PERIOD, thinning, (t, q, qd, qdd, tau), segments)


def exact(joints, period, thinning, samples, segments=None):
    """A motion without noise; ``samples``: time (n,), then position, speed, acceleration and torque (n, J)."""
    t, q, qd, qdd, tau = samples
    band, parts = 1 / (2 * thinning * period), segments or (slice(0, len(t)),)
    cold, quiet = np.full_like(q, 20.0), np.zeros((3, q.shape[1]))
    return Motion("run.csv", joints, period, band, t, q, qd, qdd, tau, cold, parts, thinning, (), quiet)


def three_joints(folder):
    """Tree and rigid body of a random arm of two revolute joints and a prismatic one."""
    for seed in range(100):
        drawn = random_arm(np.random.default_rng(seed), 3, 0.4)
        if [link.kind for link in drawn.links] == ["revolute", "revolute", "prismatic"]:
            path = folder / "arm.urdf"
            path.write_text(drawn.urdf())
            tree = load_urdf(path, (0.3, -0.2, -9.81))
            return tree, RigidBody(tree)
    raise AssertionError("no such arm in 100 draws")


def build(arm, experiment, effects, base=None, values=None):
    return TorqueModel(arm[0], effects, base, scales([experiment]), values or {})


def jacobian(assembly, experiment, theta):
    """Derivative blocks added up to one array (n, J, P)."""
    state = assembly.evaluate(experiment, theta)
    dense = np.zeros((*state.tau.shape, len(theta)))
    for block in state.blocks:
        for k, i in enumerate(block.index):
            dense[:, block.channel, i] += block.values[:, k]
    return dense
