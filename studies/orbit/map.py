"""What the joints' passive resistance does to the end of a capture: a map over friction and stiffness.

No maker publishes how hard such joints are to drive backwards; the map shows what follows from what. Its cells are run
with macro steps of 2 ms, and each is kept in the study's folder as soon as it is there: a run that was broken off goes
on where it stopped.
"""

import hashlib
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from ...files import json_value
from ...models.snare.parameters import SnareParameters
from ...tolerance.capture import source_version
from ...tolerance.inspection import SOURCES
from ..outcome import FOLDER, write_json
from .ledger import peak_force
from .setting import END, Setting, capture_of, co_simulate, radial_end, resistance

LEVELS = (1.0, 3.0, 10.0, 30.0, 100.0)
"""Coulomb level of each joint [N·m]; Stribeck level and viscous coefficient go with it."""
STIFFNESSES = (0.0, 3000.0)
"""Of a spring at each joint [N·m/rad]."""
_STEP = 2e-3


@dataclass(frozen=True)
class Cell:
    """One capture of the map: Coulomb level [N·m], stiffness [N·m/rad]; contact [s], end (y, z) [m], peak force [N]."""

    level: float
    stiffness: float
    first_contact: float
    final_y: float
    final_z: float
    peak_force: float


def resistance_map(start: Setting, snare: SnareParameters, study: str, say: Callable[[str], None]) -> list[Cell]:
    """All cells, friction by friction; from the study's folder where they are there."""
    cells = []
    for level in LEVELS:
        for stiffness in STIFFNESSES:
            path = FOLDER / study / "map" / f"{_key(start, snare, level, stiffness)}.json"
            if not path.exists():
                say(f"  map: friction {level:g} N·m, stiffness {stiffness:g} N·m/rad ...")
                path.parent.mkdir(parents=True, exist_ok=True)
                write_json(path, asdict(_cell(start, snare, level, stiffness)))
            cells.append(Cell(**json_value(path)))
    return cells


def _cell(start: Setting, snare: SnareParameters, level: float, stiffness: float) -> Cell:
    run = co_simulate(start, resistance(level, stiffness), snare, step=_STEP, own_step=_STEP)
    capture = capture_of(run, start.case)
    contact = np.inf if capture.first_contact is None else capture.first_contact
    y, z = radial_end(capture).tolist()
    return Cell(level, stiffness, contact, y, z, peak_force(capture))


def _key(start: Setting, snare: SnareParameters, level: float, stiffness: float) -> str:
    """Of everything that a cell follows from, the text of models and master included."""
    given = start.case, start.target, snare, level, stiffness, _STEP, END, source_version(*SOURCES)
    return hashlib.sha256(repr(given).encode()).hexdigest()[:20]
