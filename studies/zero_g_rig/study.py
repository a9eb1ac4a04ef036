"""Parts (a) to (c) of the study: the rigid model's error, friction, and the error that friction leaves."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...identification.fitting.assembly import TorqueModel
from ...identification.fitting.experiment import Experiment, load_experiments, scales
from ...identification.fitting.fit import Fit
from ...models.model import Model
from ...models.rigid_body import RigidBody
from .friction import SlideFrictionCurve, curves, jointly, tip_to_base

Array = NDArray[np.float64]

MODEL = Path(__file__).parent / "model.toml"
"""What the paper's model knows once friction is in it."""


@dataclass(frozen=True, eq=False)
class Traces:
    """One recording in the analysis band: time (n,); torques measured, of the rigid arm, and with friction (n, 7)."""

    time: Array
    q: Array
    measured: Array
    rigid: Array
    tip_to_base: Array
    friction: Array

    def error(self, modelled: Array) -> Array:
        """Mean torque error of each joint (7,) [N·m]."""
        return np.mean(np.abs(self.measured - modelled), axis=0)

    @property
    def reduction(self) -> Array:
        """Share of the mean error that friction takes away (7,)."""
        return 1.0 - self.error(self.friction) / self.error(self.rigid)


@dataclass(frozen=True, eq=False)
class Friction:
    """Friction as identified: the joint fit, its curves, and both recordings."""

    fit: Fit
    curves: list[SlideFrictionCurve]
    train: Traces
    holdout: Traces
    experiments: list[Experiment]
    locked: list[Experiment]


def friction_study(model: Model, train: Path, holdout: Path, progress: Callable[[str], None]) -> Friction:
    """Rigid model, friction tip to base, friction jointly; on the recording fitted and on the one held out."""
    body = RigidBody(model.tree)
    experiments = load_experiments(model, [train], body)
    locked = load_experiments(model, [holdout], body, experiments[0].motion.band)
    values = tip_to_base(model, experiments, progress)
    progress("friction of all joints together")
    found = jointly(model, experiments, values)
    bare = TorqueModel(model.tree, [], None, scales(experiments), {})
    first = TorqueModel(model.tree, model.effects, None, scales(experiments), values)

    def traces(e: Experiment) -> Traces:
        band = e.motion.to_band
        modelled = [(bare, bare.start), (first, first.start), (found.assembly, found.theta)]
        torques = [band(assembly.torque(e, theta)) for assembly, theta in modelled]
        return Traces(band(e.motion.time), band(e.motion.q), e.measured, *torques)

    return Friction(found, curves(found, experiments), traces(experiments[0]), traces(locked[0]), experiments, locked)
