"""Friction at the slides, identified tip to base, then jointly; and its curves with bands.

A joint feels its own slide's friction and that of every joint further out (the paper's section 2.3), so the last joint
is fitted first, on its own torque alone, and each fit after it takes what lies further out as known. All joints
together then correct what the order of the fits spoiled. Parameters of the law are hardly ever determined one by one;
its curve over the speeds travelled is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ...identification.fitting.assembly import TorqueModel
from ...identification.fitting.experiment import Experiment, scales
from ...identification.fitting.fit import Fit, fit
from ...identification.fitting.problem import Problem
from ...identification.fitting.starts import best_start
from ...models.effects import get_effect
from ...models.hidden_state import evaluate_law
from ...models.model import Model, PlacedEffect
from ...models.rig.kinematics import slide_map
from ...models.rig.rig import Rig

Array = NDArray[np.float64]

FRICTION = "slide_friction"

BINS = 4
"""Of speed, each way, in which the law's misfit is judged."""


@dataclass(frozen=True, eq=False)
class SlideFrictionCurve:
    """Friction force at each contact of one joint's slide over the joint's speed; arrays (n_speeds,).

    Parameters
    ----------
    joint : str
    speed : array
        Speeds travelled in the recordings, both ways [rad/s].
    force, std : array
        [N]
    carried : tuple of str
        Parameters that the recordings determine to better than half their value.
    not_carried : tuple of str
        All others: not to be read as facts.
    """

    joint: str
    speed: Array
    force: Array
    std: Array
    carried: tuple[str, ...]
    not_carried: tuple[str, ...]


def tip_to_base(model: Model, train: Sequence[Experiment], progress: Callable[[str], None]) -> dict[str, float]:
    """Friction parameters by key, fitted joint by joint from the tip, each to its own torque."""
    known, values = scales(train), dict(model.values)
    rng = np.random.default_rng(0)
    done: list[PlacedEffect] = []
    for p in reversed([p for p in model.effects if p.effect.name == FRICTION]):
        joint = model.joints.index(p.at)
        progress(f"friction of {p.at}, with all beyond it known")
        assembly = TorqueModel(model.tree, [p, *done], None, known, values)
        problem = Problem(assembly, tuple(train), np.array([joint]), np.arange(len(assembly.slots)))
        sigma = np.sqrt(np.mean(np.concatenate([e.measured[:, joint] for e in train]) ** 2, keepdims=True))
        theta, _, _ = best_start(problem, assembly.start, sigma, rng)
        theta = problem.minimise(theta, sigma).theta
        values |= assembly.values(theta)
        done.append(replace(p, hold=tuple(x.name for x in p.effect.parameters)))
    return values


def jointly(model: Model, train: Sequence[Experiment], values: dict[str, float]) -> Fit:
    """All slides' friction fitted to all torques together, from what tip to base found."""
    assembly = TorqueModel(model.tree, model.effects, None, scales(train), values)
    return fit(assembly, train, multi_start=False)


def curves(found: Fit, train: Sequence[Experiment], points: int = 40) -> list[SlideFrictionCurve]:
    """Each slide's curve over the speeds that its joint travelled at, with its standard deviation.

    Two parts: what noise leaves open (delta method), and the misfit of the law's form, from what is left of the joint's
    own torque in bins of its speed.
    """
    drawn = []
    effect = get_effect(FRICTION)
    for k, p in enumerate(found.assembly.placed):
        if p.effect.name != FRICTION:
            continue
        joint = found.assembly.joint_of(p)
        rate = np.concatenate([e.motion.qd[:, joint] for e in train])
        parameters, index = found.assembly.parameters(k, found.theta), found.assembly.index_of(p)
        speed = _travelled(rate, points)
        law = evaluate_law(effect, {"qd": speed}, parameters)
        by = law.by_parameter[:, 0]
        variance = np.einsum("np,pr,nr->n", by, found.covariance[np.ix_(index, index)], by)
        names = [x.name for x in effect.parameters]
        variance += _misfit(found, train, joint, speed) ** 2
        good = found.std[index] < 0.5 * np.abs(found.theta[index])
        drawn.append(
            SlideFrictionCurve(
                p.at,
                speed,
                law.values[:, 0],
                np.sqrt(np.maximum(variance, 0.0)),
                tuple(n for n, g in zip(names, good, strict=True) if g),
                tuple(n for n, g in zip(names, good, strict=True) if not g),
            )
        )
    return drawn


def _misfit(found: Fit, train: Sequence[Experiment], joint: int, speed: Array) -> float:
    """RMS, over bins of speed, of the mean force that the law leaves [N].

    Noise in these means is not taken off: a misfit smaller than noise lets it be seen cannot be ruled out.
    """
    assembly = found.assembly
    left = np.concatenate([assembly.residual(e, found.theta)[0][:, joint] for e in train])
    rate = np.concatenate([e.motion.to_band(e.motion.qd)[:, joint] for e in train])
    means = []
    for way in (speed < 0, speed > 0):
        for low, high in pairwise(np.linspace(speed[way].min(), speed[way].max(), BINS + 1)):
            inside = left[(rate >= low) & (rate <= high)]
            if len(inside):
                means.append(float(np.mean(inside)))
    lever = float(slide_map(cast(Rig, assembly.tree), joint, np.zeros((1, assembly.tree.n_joints)))[0, joint, 0])
    return float(np.sqrt(np.mean(np.square(means)))) / lever


def _travelled(rate: Array, points: int) -> Array:
    """Speeds from a tenth of the peak up to the peak, each way that the joint went: below, it only passes through."""
    ways = []
    for sign in (-1.0, 1.0):
        peak = float(np.max(sign * rate))
        if peak > 0.2 * np.max(np.abs(rate)):
            ways.append(sign * np.linspace(0.1, 1.0, points // 2) * peak)
    return np.sort(np.concatenate(ways))
