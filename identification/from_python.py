"""The commands as Python calls: `diagnose`, `identify`, `check` and `simulate` on files or on what is already loaded.

The package gives them as ``snarelab.diagnose``, ``snarelab.identify``, ``snarelab.check`` and ``snarelab.simulate``.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeAlias

import pandas as pd
import xarray as xr

from ..models.model import Model
from ..models.model_file import load_model
from . import diagnose as diagnosing
from . import identify as identifying
from . import simulate as simulating
from .checks import run as checking
from .in_memory import RecordingLike, as_files
from .results import CheckResult, DiagnosisResult, IdentificationResult, ParameterEstimate

ModelLike: TypeAlias = str | Path | Model
"""A model file's path, or a `Model` that was loaded."""


def diagnose(
    model: ModelLike,
    recordings: RecordingLike | Sequence[RecordingLike],
    *,
    holdout: RecordingLike | Sequence[RecordingLike],
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
    jobs: int | None = None,
    anyway: bool = False,
) -> DiagnosisResult:
    """Find, name and add the physics that a model leaves out; confirm it on a held-out recording.

    Parameters
    ----------
    model : path or Model
        What is believed of the hardware.
    recordings : path, xarray.Dataset or pandas.DataFrame, or a sequence of them
        Fitted and searched. A table in memory has the columns of a file: ``time``, ``q.<joint>``, ``tau.<joint>``.
    holdout : path, xarray.Dataset or pandas.DataFrame, or a sequence of them
        Held out: they confirm names, and no fit sees them. None may be one of ``recordings``.
    progress : callable
        Called with a few words on what is under way, for example ``print``.
    seed : int
        Of random starts.
    jobs : int, optional
        Processes in which captures are simulated, by default one for each core, at most four; other systems refuse it.
    anyway : bool
        Go on where recordings and model contradict each other; otherwise the verdict is ``data_fault``.

    Returns
    -------
    DiagnosisResult
        Frozen; prints as the verdict and a table, and shows itself in a notebook.

    Raises
    ------
    InputError
        The model or a recording cannot be used; one line says why.

    Examples
    --------
    An arm that another engine simulated, with more physics than its model has:

    >>> import snarelab
    >>> from importlib.resources import files
    >>> arm = files("snarelab.studies") / "bundled"
    >>> found = snarelab.diagnose(arm / "arm3.toml", arm / "train.csv", holdout=arm / "holdout.csv")
    >>> found.verdict
    'missing_physics'
    >>> sorted(effect.at for effect in found.effects if effect.name == "coulomb_friction")
    ['joint1', 'joint2', 'joint3']
    >>> level = found.effects[0].parameters["level"]
    >>> level.unit, level.std < 0.1 * level.value
    ('N*m', True)
    >>> found.steps[-1].holdout < 0.1 * found.steps[0].holdout
    True
    >>> found.save_model("arm3-new.toml")
    """
    given = _model(model)
    train, locked = _several(recordings), _several(holdout)
    with as_files([*train, *locked]) as paths:
        fitted, held = paths[: len(train)], paths[len(train) :]
        answer = diagnosing.diagnose(given, fitted, held, progress=progress, seed=seed, jobs=jobs, anyway=anyway)
    return DiagnosisResult(answer.diagnosis, answer.model)


def identify(
    model: ModelLike,
    recordings: RecordingLike | Sequence[RecordingLike],
    *,
    holdout: RecordingLike | Sequence[RecordingLike] = (),
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
    jobs: int | None = None,
) -> IdentificationResult:
    """Fit every parameter of a model to all recordings jointly.

    Parameters
    ----------
    model : path or Model
        What is believed.
    recordings : path, xarray.Dataset or pandas.DataFrame, or a sequence of them
        Fitted.
    holdout : the same
        Recordings on which the fit is only evaluated; none by default.
    progress : callable
        Told in a few words what is under way.
    seed : int
        Of the random starts.
    jobs : int, optional
        Processes in which captures are simulated, by default one a core, at most four; other systems refuse it.

    Returns
    -------
    IdentificationResult
        Frozen; prints as a table of parameters, and shows itself in a notebook.

    Raises
    ------
    InputError
        Whatever is wrong with the model or a recording, in one line.

    Examples
    --------
    >>> import snarelab
    >>> from importlib.resources import files
    >>> arm = files("snarelab.studies") / "bundled"
    >>> fitted = snarelab.identify(arm / "arm3.toml", arm / "train.csv", holdout=arm / "holdout.csv")
    >>> [f"{p.effect} at {p.at}" for p in fitted.parameters]
    ['viscous_friction at joint1', 'viscous_friction at joint2', 'viscous_friction at joint3']
    >>> fitted.fit["tau.joint1"]["holdout"]["relative"] < 0.2
    True
    """
    given = _model(model)
    train, locked = _several(recordings), _several(holdout)
    with as_files([*train, *locked]) as paths:
        fitted, held = paths[: len(train)], paths[len(train) :]
        found = identifying.identify(given, fitted, held, progress=progress, seed=seed, jobs=jobs)
        published = found.to_json()
    names = ParameterEstimate.__dataclass_fields__
    parameters = tuple(ParameterEstimate(**{name: p[name] for name in names}) for p in published["parameters"])
    return IdentificationResult(parameters, published["fit"], published["condition"], found.model, published)


def check(
    model: ModelLike,
    recordings: RecordingLike | Sequence[RecordingLike],
    *,
    progress: Callable[[str], None] = lambda _: None,
) -> CheckResult:
    """See whether recordings can belong to a model: units, signs, channels, gravity, clocks, and one another.

    Parameters
    ----------
    model : path or Model
        What is believed.
    recordings : path, xarray.Dataset or pandas.DataFrame, or a sequence of them
    progress : callable
        Told in a few words what is under way.

    Returns
    -------
    CheckResult
        Findings, each with a place, a message and the line that mends it; prints as one line each.

    Raises
    ------
    InputError
        Whatever is wrong with the model or a recording, in one line.

    Examples
    --------
    >>> import snarelab
    >>> from importlib.resources import files
    >>> arm = files("snarelab.studies") / "bundled"
    >>> snarelab.check(arm / "arm3.toml", [arm / "train.csv", arm / "holdout.csv"]).checks
    ()
    """
    with as_files(_several(recordings)) as paths:
        return CheckResult(*checking.check_file(model, paths, progress=progress))


def simulate(model: ModelLike, motion: RecordingLike | None = None) -> xr.Dataset:
    """Torque that a model gives along a recorded motion; what the sensors of a capture read.

    Parameters
    ----------
    model : path or Model
        With values of all its parameters: a file that ``save_model`` wrote, or the ``model`` of a result.
    motion : path, xarray.Dataset, pandas.DataFrame or None
        The motion to follow. A capture needs none.

    Returns
    -------
    xarray.Dataset
        ``q qd qdd tau`` of every joint over ``time`` [s], SI units; of a capture, its own channels.

    Raises
    ------
    InputError
        A parameter without a value, or whatever is wrong with the recording.

    Examples
    --------
    >>> import snarelab
    >>> from importlib.resources import files
    >>> arm = files("snarelab.studies") / "bundled"
    >>> fitted = snarelab.identify(arm / "arm3.toml", arm / "train.csv")
    >>> run = snarelab.simulate(fitted.model, arm / "holdout.csv")
    >>> sorted(name for name in run if name.startswith("tau"))
    ['tau.joint1', 'tau.joint2', 'tau.joint3']
    """
    with as_files([] if motion is None else [motion]) as paths:
        return simulating.simulate(_model(model), paths[0] if paths else None)


def _model(model: ModelLike) -> Model:
    return model if isinstance(model, Model) else load_model(model)


def _several(recordings: RecordingLike | Sequence[RecordingLike]) -> list[RecordingLike]:
    single = isinstance(recordings, str | Path | xr.Dataset | pd.DataFrame)
    return [recordings] if single else list(recordings)
