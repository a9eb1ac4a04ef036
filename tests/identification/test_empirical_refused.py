"""A table for a nameless curve is kept where the held-out recording gains by it, and only there.

The tables, their fit and the held-out density are those of a diagnosis; which curve is left is said by hand.
"""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from moving_arm import build, motion, placed

from snarelab.identification import empirical
from snarelab.identification.empirical import EmpiricalLaw, empirical_laws
from snarelab.identification.fitting.experiment import Experiment
from snarelab.identification.fitting.fit import Fit, fit
from snarelab.identification.nuisance.covariance import Covariance
from snarelab.models.inertia import from_central
from snarelab.models.rigid_body import RigidBody
from snarelab.models.tree import Joint, Link, Tree
from snarelab.recordings.condition import Motion

Law = Callable[[Motion], np.ndarray]

NOISE, N = 0.1, 2400
VISCOUS = placed(("viscous_friction", "joint1"))
pytestmark = pytest.mark.usefixtures("own_cache")


def bump(m: Motion) -> np.ndarray:
    """2 N·m over position: no sine, no polynomial."""
    return 2.0 * np.exp(-(((m.q - 0.2) / 0.15) ** 2))


def nothing(m: Motion) -> np.ndarray:
    return np.zeros_like(m.q)


@pytest.fixture(scope="module")
def pendulum() -> tuple[Tree, RigidBody]:
    joint = Joint("joint1", "revolute", np.array([0.0, 1.0, 0.0]), -1, np.eye(3), np.zeros(3))
    link = Link("link1", from_central(4.0, [0.4, 0.0, 0.0], 0.02 * np.eye(3)))
    tree = Tree("pendulum", (joint,), (link,), np.array([0.0, 0.0, -9.81]))
    return tree, RigidBody(tree)


def recorded(pendulum, first: int, law: Law) -> Experiment:
    """Viscous friction of 0.5 N·m·s/rad, noise, and a nameless law; from sample ``first`` of an endless motion."""
    moved = motion(["revolute"], N, first=first)
    own = Experiment(moved, pendulum[1])
    assembly = build(pendulum, own, VISCOUS)
    tau = assembly.torque(own, np.array([0.5])) + NOISE * np.random.default_rng(first).normal(size=(N, 1))
    return Experiment(replace(moved, tau=tau + law(moved)), pendulum[1])


def tabulated(pendulum, in_training: Law, in_held_out: Law) -> tuple[Fit, Fit, tuple[EmpiricalLaw, ...]]:
    """The fit before and after, and the laws found, where a curve over position is left."""
    train, held = recorded(pendulum, 0, in_training), recorded(pendulum, N, in_held_out)
    final = fit(build(pendulum, train, VISCOUS), [train])
    channels = []
    for e in (train, held):
        n, thinning = len(e.measured), e.motion.thinning
        white = Covariance(np.full(n, NOISE**2 / thinning), (), None, thinning * e.motion.period, [slice(0, n)])
        channels.append([SimpleNamespace(covariance=white)])
    weighed = SimpleNamespace(evidence=SimpleNamespace(channels=channels), scale=np.std(train.measured, axis=0))
    best = SimpleNamespace(names=(), found=SimpleNamespace(weighed=weighed))
    left = SimpleNamespace(curves=[SimpleNamespace(channel=0, over="position")])
    decided: Any = SimpleNamespace(left=left, best=best)
    return final, *empirical_laws(decided, final, [train], [held])


def test_a_curve_that_both_recordings_have_is_kept(pendulum):
    before, after, (law,) = tabulated(pendulum, bump, bump)
    assert (law.at, [t.over for t in law.tables]) == ("joint1", [("position",)])
    assert law.gain > 100
    assert after.sigma[0] < 1.1 * NOISE < before.sigma[0]


def test_a_curve_of_the_training_recording_alone_is_not_kept(pendulum):
    before, after, laws = tabulated(pendulum, bump, nothing)
    assert laws == ()
    assert after is before


@pytest.mark.parametrize(("sure", "kept"), [(1.99, 0), (2.01, 1)])
def test_a_table_is_kept_from_two_standard_errors_on(monkeypatch, pendulum, sure, kept):
    monkeypatch.setattr(empirical, "_confirmed", lambda *_: (1.0, sure))
    _, _, laws = tabulated(pendulum, bump, bump)
    assert len(laws) == kept
