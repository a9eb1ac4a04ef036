"""All checks on a model and its recordings, in their order."""

from collections.abc import Callable, Sequence
from pathlib import Path

import xarray as xr

from ..errors import InputError
from ..identification.fitting.experiment import Experiment, load_experiments, with_silence
from ..identification.fitting.recorded import read_all, with_recorded_joints
from ..models.model import Model
from ..models.rigid_body import RigidBody
from ..models.snare.setup import SnareTree
from .case import Case
from .compete import compete, findings
from .finding import Finding
from .kinds import ORDER, kinds


def check(
    model: Model, recordings: Sequence[str | Path], *, progress: Callable[[str], None] = lambda _: None
) -> tuple[Finding, ...]:
    """Findings on recordings that were not read yet; raises InputError for whatever is wrong with a file.

    A recording that cannot be conditioned is left to what can be said without.
    """
    if not recordings:
        raise InputError("recordings: none is given; give one or more")
    if isinstance(model.tree, SnareTree):
        raise InputError(f"{model.path}: system = 'snare_capture' has no joints that could be checked")
    progress("reading and conditioning the recordings")
    datasets = read_all(model, recordings)
    model = with_recorded_joints(model, datasets)
    body = RigidBody(model.tree)
    experiments = with_silence(load_experiments(model, recordings, body, datasets=datasets))
    return run_checks(model, datasets, experiments, progress)


def run_checks(
    model: Model,
    datasets: Sequence[xr.Dataset],
    experiments: Sequence[Experiment],
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[Finding, ...]:
    """Findings on recordings as read and conditioned, those of contradiction first.

    What is found early (a jump, a clock) ends it: readings cannot be compared on what is no motion. Of the readings
    that compete the best one is told; what recordings contradict each other in is only asked where it is none.
    """
    progress("checking whether the recordings can belong to the model")
    case = Case(model, datasets, experiments, progress)
    found: list[Finding] = []
    for kind in kinds():
        if kind.early and kind.find is not None:
            found += kind.find(case)
    if not any(f.fault for f in found) and case.comparable:
        readings = [r for kind in kinds() if kind.readings is not None for r in kind.readings(case)]
        found += findings(case, compete(case, readings))
    contradicted = any(f.fault for f in found)
    for kind in kinds():
        if kind.find is not None and not kind.early and not (contradicted and kind.name in ("mixed", "saturation")):
            found += kind.find(case)
    return tuple(sorted(found, key=lambda f: (not f.fault, ORDER.index(f.name))))
