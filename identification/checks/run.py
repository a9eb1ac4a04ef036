"""All checks on a model and its recordings, in their order."""

from collections.abc import Callable, Sequence
from pathlib import Path

import xarray as xr

from ...errors import InputError
from ...models.model import Model
from ...models.model_file import load_model
from ...models.rigid_body import RigidBody
from ..fitting.constants import with_constants
from ..fitting.experiment import Experiment, load_experiments, with_silence
from ..fitting.recorded import read_all, with_recorded_joints
from .case import CheckCase
from .compete import compete, findings, is_sound
from .finding import CheckFinding
from .kinds import ORDER, kinds


def check(
    model: Model, recordings: Sequence[str | Path], *, progress: Callable[[str], None] = lambda _: None
) -> tuple[CheckFinding, ...]:
    """Findings on recordings that are yet to be read; raises InputError for a file that cannot be used.

    For a recording that cannot be conditioned, only the checks before conditioning are made."""
    if not recordings:
        raise InputError("recordings: none is given; give one or more")
    if model.tree.simulated_as:
        raise InputError(f"{model.path}: system = {model.system!r} has no joints that could be checked")
    progress("reading and conditioning the recordings")
    datasets = read_all(model, recordings)
    model = with_recorded_joints(model, datasets)
    found = early_checks(model, datasets)
    if any(f.fault for f in found):
        return found
    model, datasets, _ = with_constants(model, datasets, len(datasets))
    experiments = with_silence(load_experiments(model, recordings, RigidBody(model.tree), datasets=datasets))
    return run_checks(model, datasets, experiments, found, progress)


def check_file(
    model: str | Path | Model, recordings: Sequence[str | Path], *, progress: Callable[[str], None] = lambda _: None
) -> tuple[str, tuple[CheckFinding, ...]]:
    """A model's name, and the findings; a moving body that no body can be is one of them, and mended for the others."""
    if not isinstance(model, Model):
        model = load_model(model, fix="nearest")
    return model.name, check(model, recordings, progress=progress)


def early_checks(model: Model, datasets: Sequence[xr.Dataset]) -> tuple[CheckFinding, ...]:
    """Checks before any filter: jumps and wrong clocks.

    With such a finding readings cannot be compared: the recording is no continuous motion."""
    case = CheckCase(model, datasets, ())
    return _sorted([f for kind in kinds() if kind.early and kind.find is not None for f in kind.find(case)])


def run_checks(
    model: Model,
    datasets: Sequence[xr.Dataset],
    experiments: Sequence[Experiment],
    early: Sequence[CheckFinding] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[CheckFinding, ...]:
    """Findings on recordings as read and conditioned, after what was found early; those of contradiction first.

    Of the readings that compete the best one is told. What is cut off, and what recordings contradict each other in, is
    only asked where there is none.
    """
    progress("checking whether the recordings can belong to the model")
    case = CheckCase(model, datasets, experiments, progress)
    found = list(early)
    if not any(f.fault for f in found) and case.comparable and not is_sound(case):
        readings = [r for kind in kinds() if kind.readings is not None for r in kind.readings(case)]
        found += findings(case, compete(case, readings))
    contradicted = any(f.fault for f in found)
    for kind in kinds():
        if kind.find is not None and not kind.early and not (contradicted and kind.name in ("mixed", "saturation")):
            found += kind.find(case)
    return _sorted(found)


def _sorted(found: Sequence[CheckFinding]) -> tuple[CheckFinding, ...]:
    """Contradictions first, then in the order of kinds."""
    return tuple(sorted(found, key=lambda f: (not f.fault, ORDER.index(f.name))))
