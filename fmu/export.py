"""``snarelab export``: FMUs of an arm or a capture from a model file, of a built-in model, or of a participant."""

import os
from dataclasses import asdict
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..models.docking.bench_setup import DockingTree
from ..models.floating.arm import FloatingArm
from ..models.floating.ets_vii import ets_vii
from ..models.floating.tree import FloatingTree, arm_on
from ..models.model import Model
from ..models.model_file import load_model
from ..models.snare.setup import SnareTree
from .arm import arm_equations
from .build import write_fmu
from .elements import ELEMENTS
from .equations import Equations
from .hosted import capture_class, participant_names, write_hosted, write_hosted_class
from .inverse import inverse_equations
from .placed_laws import identifier


def export(what: str, version: int, out: str | Path, inverse: bool = False, stiff: bool | None = None) -> None:
    """Write an FMU, all or nothing.

    Parameters
    ----------
    what : str
        A model file (``.toml``), or the name of a built-in model or a participant.
    version : 2 or 3
        Of FMI.
    out : path
    inverse : bool
        Model files only: motion in, torque out.
    stiff : bool or None
        The arm's integrator; None chooses.

    Raises
    ------
    InputError
        An unknown name (with the known ones), a model that cannot be exported, or a place that cannot be written.
    """
    out = Path(out)
    if out.suffix != ".fmu":
        raise InputError(f"{out}: an FMU's name ends in .fmu; name it so")
    if not (out.parent.is_dir() and os.access(out.parent, os.W_OK)):
        raise InputError(f"{out}: its folder does not exist or cannot be written; make it first")
    if what.endswith(".toml") or Path(what).is_file():
        model = load_model(what)
        if stiff is not None and (inverse or isinstance(model.tree, SnareTree)):
            raise InputError(f"{what}: nothing is integrated that --integrator could be for; leave it out")
        if isinstance(model.tree, DockingTree):
            raise InputError(f"{what}: a docking test is no FMU; its end effector is: give hover_end_effector")
        if isinstance(model.tree, SnareTree):
            _export_capture(model, model.tree, version, out, inverse)
            return
        write_fmu(inverse_equations(model) if inverse else model_equations(model, stiff), out, version)
        return
    if inverse:
        raise InputError(f"{what}: --inverse is for model files (.toml)")
    if stiff is not None:
        raise InputError(f"{what}: --integrator is for the arms of model files (.toml); leave it out")
    if what in ELEMENTS:
        write_fmu(ELEMENTS[what](), out, version)
    elif what in participant_names():
        write_hosted(what, out, version)
    else:
        known = ", ".join(sorted({*ELEMENTS, *participant_names()}))
        raise InputError(f"{what!r} is neither a model file (.toml) nor a participant; known participants: {known}")


def _export_capture(model: Model, tree: SnareTree, version: int, out: Path, inverse: bool) -> None:
    """A capture's model file: Python beside the importer, as the snare needs it."""
    if inverse:
        raise InputError(f"{model.path}: --inverse follows the joints of an arm, and a capture has none; leave it out")
    model.demand_values()
    setup = tree.setup.with_values(model.values)
    arguments = {
        "parameters": asdict(setup.parameters),
        "target": asdict(setup.target),
        "effects": [p.effect.name for p in model.effects],
    }
    write_hosted_class(capture_class(), arguments, out, version, identifier(model.name))


def model_equations(model: Model, stiff: bool | None = None) -> Equations:
    """Forward dynamics of a model file's arm; its tip is the last link's frame, ETS-VII's its end effector."""
    tree = model.tree
    if isinstance(tree, FloatingTree):
        arm = ets_vii() if model.urdf is None else arm_on(tree, tree.phi)
    else:
        arm = FloatingArm(tree, np.zeros(10), tree.n_joints - 1, floating=False)
    return arm_equations(model, arm, stiff)
