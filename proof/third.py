"""What a model leaves of the recording that nothing was given: every gain that is reported is counted there."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.experiment import load_experiments, scales
from snarelab.identification.fitting.fit import channel_rms, fit
from snarelab.identification.search.rest import fitted
from snarelab.models.model_file import load_model
from snarelab.models.rigid_body import RigidBody

NAME = "third.csv"


def closing(folder: Path, model: Path, band: float) -> dict[str, list[float]]:
    """RMS [N·m] on a case's third recording by channel: of a fit without a name, of the model that was found, and of
    the oracle, a fit to the case's twin, in which nothing is concealed.

    Parameters
    ----------
    folder : Path
        Of the case: ``arm.toml``, its recordings, and the twin's in ``twin``.
    model : Path
        What was found; where it is not there, nothing was.
    band : float
        [Hz], of what was found.
    """
    before = left(folder, folder / "arm.toml", band, refit=True)
    after = left(folder, model, band, refit=False) if model.exists() else before
    oracle = left(folder / "twin", folder / "twin" / "arm.toml", band, refit=True)
    return {channel: [before[channel], after[channel], oracle[channel]] for channel in before}


def left(folder: Path, model: Path, band: float, *, refit: bool) -> dict[str, float]:
    """RMS of a model's residual [N·m] along a case's third recording below a band, by channel.

    Parameters
    ----------
    folder : Path
        Of the case: ``train.csv`` and ``third.csv``.
    model : Path
        Its file. Without ``refit`` its values are used as they are, if every parameter has one: where the recordings
        are at fault nothing was fitted, and the model is the one as given.
    band : float
        [Hz]
    refit : bool
        Fit the parameters to ``train.csv``.
    """
    read = load_model(model)
    body = RigidBody(read.tree)
    train = load_experiments(read, [folder / "train.csv"], body, band)
    last = load_experiments(read, [folder / NAME], body, train[0].motion.band)
    assembly = TorqueModel(read.tree, read.effects, None, scales(train), read.values)
    if refit or any(s.key not in read.values for s in assembly.slots):
        theta: NDArray = fit(assembly, fitted(assembly, train)).theta
    else:
        theta = np.array([read.values[s.key] for s in assembly.slots])
    return dict(
        zip((f"tau.{joint}" for joint in read.joints), channel_rms(assembly, last, theta)[0].tolist(), strict=True)
    )
