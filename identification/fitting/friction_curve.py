"""Friction over speed, with its uncertainty: what the recordings carry where single parameters mean little.

Parameters of a friction law trade off against one another, and none may be known while their curve is. The band comes
from the parameters' joint covariance S through the law's derivative G (the delta method): var f = diag(G S G').
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.axes import Place, place
from ...models.hidden_state import evaluate_law, reads
from ...models.model import PlacedEffect
from ...report.bins import binned
from ..diagnosis import FrictionCurve
from .experiment import Experiment
from .fit import Fit

Array = NDArray[np.float64]

POINTS = 61
"""Speeds at which a curve is drawn, evenly over the speeds travelled and dense near rest."""


def friction_curves(found: Fit, experiments: Sequence[Experiment]) -> list[FrictionCurve]:
    """Curve of every place whose friction depends on speed alone, over the speeds of the recordings."""
    assembly = found.assembly
    places: dict[tuple[str, str], list[tuple[int, PlacedEffect]]] = {}
    for k, p in enumerate(assembly.placed):
        opposes = p.effect.at in ("joint", "slide") and p.effect.acts_on == "torque"
        if opposes and not p.effect.states and "qd" in (own := set(reads(p.effect))) and own <= {"qd", "speed_scale"}:
            places.setdefault((p.effect.at, p.at), []).append((k, p))
    curves = []
    for (kind, at), members in places.items():
        joint = assembly.joint_of(members[0][1])
        here = place(assembly.tree, at)
        speed = _speeds(experiments, here)
        scale = assembly.speed_scale(members[0][1])
        parts, slope = [], np.zeros((len(speed), len(found.theta)))
        for k, p in members:
            law = evaluate_law(p.effect, _signals(speed, scale), assembly.parameters(k, found.theta))
            free = [x.name not in p.hold for x in p.effect.parameters]
            parts.append(law.values[:, 0])
            slope[:, assembly.index_of(p)] += law.by_parameter[:, 0][:, free]
        std = np.sqrt(np.maximum(np.einsum("np,pq,nq->n", slope, found.covariance, slope), 0.0))
        prismatic = assembly.tree.joints[joint].kind == "prismatic"
        unit = "N" if kind == "slide" or prismatic else "N*m"
        measured = (
            _measured(found, experiments, joint, members, scale) if kind == "joint" and here.alone is not None else None
        )
        names = tuple(p.effect.name for _, p in members)
        curves.append(FrictionCurve(at, kind, names, speed, np.sum(parts, axis=0), std, unit, tuple(parts), measured))
    return curves


def _signals(speed: Array, scale: float) -> dict[str, Array]:
    return {"qd": speed, "speed_scale": np.full(len(speed), scale)}


def _measured(
    found: Fit, experiments: Sequence[Experiment], joint: int, members: Sequence[tuple[int, PlacedEffect]], scale: float
) -> tuple[Array, Array, Array] | None:
    """Measured torque of a joint less everything in the model but some laws, over its speed: bin centres, mean and
    standard deviation in each; None where it was not recorded in motion."""
    speeds, torques = [], []
    for e in experiments:
        speed = e.motion.to_band(e.motion.qd)[:, joint]
        left = found.assembly.residual(e, found.theta)[0][:, joint]
        for k, p in members:
            law = evaluate_law(p.effect, _signals(speed, scale), found.assembly.parameters(k, found.theta))
            left = left + law.values[:, 0]
        # Where a sample is no data, the residual says nothing: the points would be the fitted laws.
        told = np.ones(len(speed), bool) if e.kept is None else e.kept[:, joint]
        if joint not in e.motion.silent:
            speeds.append(speed[told])
            torques.append(left[told])
    speed, torque = np.concatenate([*speeds, np.zeros(0)]), np.concatenate([*torques, np.zeros(0)])
    if len(speed) == 0 or not np.ptp(speed) > 0:
        return None
    at, mean, spread = binned(speed, torque)
    told = np.isfinite(mean)
    return (at[told], mean[told], spread[told]) if told.any() else None


def identifiable(found: Fit) -> NDArray[np.bool_]:
    """Whether the recordings carry a parameter (P,): a standard deviation below its value, and no shape at a bound."""
    shapes = {f"{p.key}.{x.name}" for p in found.assembly.placed for x in p.effect.parameters if x.grid}
    is_shape = np.array([s.key in shapes for s in found.assembly.slots], bool)
    return (found.std <= np.abs(found.theta)) & ~(is_shape & found.at_bound)


def _speeds(experiments: Sequence[Experiment], here: Place) -> Array:
    """Speeds travelled, closer together near rest, where friction bends."""
    speeds = np.concatenate([here.coordinate(e.motion.qd) for e in experiments])
    even = np.linspace(-1.0, 1.0, POINTS)
    way = np.sign(even) * even**2
    return np.where(way < 0, -way * min(float(speeds.min()), 0.0), way * max(float(speeds.max()), 0.0))
