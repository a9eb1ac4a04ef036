"""The oracle: what the tool's own fit leaves of the same arm with nothing concealed in it.

Nobody can ask a name to close more than this. The floor of disturbance and noise can lie far lower: identified numbers
have errors, and no law of friction tells what a joint that stood still before the recording began holds.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.experiment import load_experiments, scales
from snarelab.identification.fitting.fit import channel_rms, fit
from snarelab.identification.search.rest import fitted
from snarelab.models.model_file import load_model
from snarelab.models.rigid_body import RigidBody

from .cases import HOLDOUT, RATE, draw
from .plant import band_rms, floor


@dataclass(frozen=True)
class Wanted:
    """A case by what it is drawn from, and the bands [Hz] in which its oracle is wanted; none where nothing closes."""

    plan: tuple[str, tuple[str, ...], float]
    seed: int
    number: int
    attempt: int
    bands: tuple[float, ...]


def run(wanted: Wanted) -> dict[str, Any]:
    """``over_floor``: for each band the holdout error of every channel over its floor.

    ``none`` says why there is no oracle, where its arm cannot be recorded; the floor stands for it then.
    """
    if not wanted.bands:
        return {"over_floor": []}
    case = draw(wanted.plan, wanted.seed, wanted.number, wanted.attempt)
    lowest = floor(case.twin, HOLDOUT, RATE, case.noise[1])
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            replace(case, plant=case.twin, model=case.twin_model).write(folder)
        except ValueError as error:
            return {"over_floor": [{} for _ in wanted.bands], "none": str(error)}
        model = load_model(folder / "arm.toml")
        body = RigidBody(model.tree)
        for wide in wanted.bands:
            train = load_experiments(model, [folder / "train.csv"], body, wide)
            band = train[0].motion.band
            held = load_experiments(model, [folder / "hold.csv"], body, band)
            assembly = TorqueModel(model.tree, model.effects, None, scales(train), model.values)
            theta = fit(assembly, fitted(assembly, train)).theta
            left = channel_rms(assembly, held, theta)[0] / band_rms(lowest, RATE, band)
            found.append(dict(zip((f"tau.{joint}" for joint in model.joints), left.tolist(), strict=True)))
    return {"over_floor": found}


def over_floor(oracle: Mapping[str, float], channels: Sequence[str]) -> float:
    """Error over its floor, root mean square of the channels; 1 where there is no oracle."""
    return float(np.sqrt(np.mean(np.square([oracle.get(c, 1.0) for c in channels])))) if channels else 1.0
