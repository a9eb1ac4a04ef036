"""Diagnosis of link encoders beside that of the torques: what makes motor and link encoder of each joint differ."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model
from ...models.rigid_body import RigidBody
from ...recordings.part import several
from ..fitting.assembly import TorqueModel
from ..fitting.experiment import Experiment, Scales
from ..sources.decide import SourceDecision, decide
from ..sources.stages import Stage, stages
from .run import load_links
from .source import Links, links_of, start

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EncoderComparison:
    """Encoders, what was decided, the fits after each name's effect was added (training, held out), and the training
    recordings with link less motor position in place of torque."""

    links: Links
    decided: SourceDecision
    stages: tuple[Stage, ...]
    train: tuple[Experiment, ...]


def diagnose_links(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: str | Path | Sequence[str | Path],
    body: RigidBody,
    assembly: TorqueModel,
    theta: Array,
    scales: Mapping[str, Scales],
    band: float,
    *,
    progress: Callable[[str], None] = lambda _: None,
) -> EncoderComparison | None:
    """Diagnose the joints that have a second encoder in all recordings; None where none has.

    Parameters
    ----------
    model : Model
    recordings, holdout : paths
    body : RigidBody
    assembly, theta : TorqueModel, array (P,)
        Of the torques: their rigid-body part loads the drives.
    scales : mapping of str to Scales
    band : float
        Edge of the analysis band [Hz].
    progress : callable
    """
    joints, train = load_links(model, recordings, body, band)
    held: list[Experiment] = []
    if joints:
        also, held = load_links(model, several(holdout), body, band)
        joints = tuple(j for j in joints if j in also)
    if not joints:
        return None
    links = links_of(joints, model, train, held, assembly, theta, scales)
    decided = decide(links, start(links, model), lambda text: progress(f"link encoders: {text}"))
    return EncoderComparison(links, decided, tuple(stages(links, decided, "link encoders as given")), tuple(train))
