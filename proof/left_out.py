"""Calibration of each generator by a map that was counted on the others: what a machine of another hand would be told.

The tool's own map is counted on all generators, so that the error of what it told knows the generator it is held to.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .counting import Row, fitted, of_lines, probability
from .statistics import calibration_error


def calibration(rows: Mapping[str, list[Row]]) -> dict[str, dict[str, Any]]:
    """Expected calibration error of each generator's names, and how many these are; None where others told none."""
    found = {}
    for name, own in rows.items():
        others = [row for key, several in rows.items() if key != name for row in several]
        error = None
        if own and others:
            error = calibration_error(probability(fitted(others), own), np.array([r.right for r in own], float))
        found[name] = {"value": error, "cases": len(own)}
    return found


def of_files(files: Mapping[str, Path]) -> dict[str, dict[str, Any]]:
    """Of the answers that `register.run` keeps, a file a generator."""
    texts = {name: path.read_text(encoding="utf-8").splitlines() for name, path in files.items()}
    return calibration({name: of_lines([json.loads(x) for x in lines]) for name, lines in texts.items()})
