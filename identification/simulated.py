"""Kinds of recording that only a simulation of everything predicts: a folder each, under the name that the tree gives.

The folder's ``kind.py`` ends in ``KIND = SimulatedKind(...)``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol

import xarray as xr

from ..errors import InputError
from ..models.model import Model
from ..models.tree import Tree
from .diagnosis import Diagnosis


class SimulatedIdentification(Protocol):
    """A fit of such recordings: the model with its values, and the published form."""

    @property
    def model(self) -> Model:
        """With the values found."""
        ...

    def to_json(self) -> dict[str, Any]:
        """The published form."""
        ...


@dataclass(frozen=True)
class SimulatedKind:
    """What ``diagnose``, ``identify`` and ``simulate`` do with such recordings.

    Parameters
    ----------
    diagnose : callable
        ``diagnose(model, recordings, held, progress=, jobs=)``: the diagnosis, and the model with what it found.
    identify : callable
        ``identify(model, recordings, holdout, progress=, jobs=)``.
    simulate : callable
        ``simulate(model, motion)``: a recording; ``motion`` may be None.
    """

    diagnose: Callable[..., tuple[Diagnosis, Model]]
    identify: Callable[..., SimulatedIdentification]
    simulate: Callable[..., xr.Dataset]


def simulated_kind(tree: Tree) -> SimulatedKind | None:
    """The kind that a tree's recordings are of; None where a motion gives the torques.

    Loaded when asked for: what a capture needs takes longer to load than a short arm to fit.
    """
    return import_module(f".{tree.simulated_as}.kind", __package__).KIND if tree.simulated_as else None


def demand_one_process(model: Model, jobs: int | None) -> None:
    """Raise InputError where a number of processes is asked for and nothing is simulated in them."""
    if jobs is not None:
        raise InputError(
            f"{model.path}: jobs = {jobs}; only captures are simulated in several processes, and system = "
            f"{model.system!r} is computed in one; leave it out"
        )
