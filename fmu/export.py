"""What ``snarelab export`` writes: an arm from its model file, a model of the package's own, or a participant."""

import os
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..models.floating.arm import FloatingArm, load_arm
from ..models.model import Model
from ..models.model_file import load_model
from .arm import arm_equations
from .build import write_fmu
from .elements import ELEMENTS
from .equations import Equations
from .hosted import participant_names, write_hosted
from .inverse import inverse_equations


def export(what: str, version: int, out: str | Path, inverse: bool = False, stiff: bool | None = None) -> None:
    """Write an FMU, all or nothing.

    Parameters
    ----------
    what : str
        A model file (``.toml``), or the name of an element or a participant.
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
        write_fmu(inverse_equations(model) if inverse else model_equations(model, stiff), out, version)
        return
    if inverse:
        raise InputError(f"{what}: --inverse is for model files (.toml)")
    if what in ELEMENTS:
        write_fmu(ELEMENTS[what](), out, version)
    elif what in participant_names():
        write_hosted(what, out, version)
    else:
        known = ", ".join(sorted({*ELEMENTS, *participant_names()}))
        raise InputError(f"{what!r} is neither a model file (.toml) nor a participant; known participants: {known}")


def model_equations(model: Model, stiff: bool | None = None) -> Equations:
    """Forward dynamics of a model file's arm, its tip the frame of the last link that carries no other."""
    parents = {joint.parent for joint in model.tree.joints}
    tip = max(k for k in range(model.tree.n_joints) if k not in parents)
    if model.system == "free_floating_arm" and model.urdf is not None:
        arm = load_arm(model.urdf, model.tree.links[tip].name, True, model.tree.gravity)
    else:
        arm = FloatingArm(model.tree, np.zeros(10), tip, floating=False)
    return arm_equations(model, arm, stiff)
