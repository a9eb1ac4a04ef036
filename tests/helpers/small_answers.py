"""An arm of three joints, recordings and fits of it that are counted by hand."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from encoder_pairs import motion

from snarelab.identification.fitting.experiment import Experiment

NAMES = ("joint1", "joint2", "joint3")

TREE: Any = SimpleNamespace(
    carriers=0,
    joints=[SimpleNamespace(name=n, kind=k) for n, k in zip(NAMES, ("revolute", "prismatic", "revolute"), strict=True)],
    n_joints=3,
)

MODEL: Any = SimpleNamespace(tree=TREE, joints=NAMES, name="arm")


def experiment(tau, path="/data/a.csv", notes=(), **given):
    tau = np.asarray(tau, float)
    made = motion(np.zeros_like(tau) if "q" not in given else given.pop("q"), tau, joints=NAMES, path=path, **given)
    return Experiment(replace(made, notes=tuple(notes)), cast(Any, SimpleNamespace(tree=TREE)))


def fit(theta, *effects, **given) -> Any:
    """One parameter a channel, which is its torque."""
    level = np.array(theta, float)
    assembly = SimpleNamespace(
        torque=lambda e, t: np.tile(t, (len(e.motion.time), 1)), placed=effects, **given.pop("assembly", {})
    )
    return SimpleNamespace(assembly=assembly, theta=level, **given)
