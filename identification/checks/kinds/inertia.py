"""A link with mass properties that no body of the robot can have."""

import numpy as np

from ....models.inertia import to_central
from ..case import CheckCase
from ..finding import CheckFinding, Kind

REACH = 3.0
"""Radius of gyration, in lengths of the whole robot, from which on an inertia belongs to another unit."""


def find(case: CheckCase) -> list[CheckFinding]:
    """Links whose inertia was mended, and links whose radius of gyration is larger than the robot."""
    found = [
        CheckFinding(
            "inertia", note.partition("'")[2].partition("'")[0], 0.99, note, 'inertia_fix = "nearest"', fault=False
        )
        for note in case.tree.notes
        if note.startswith("inertia_fix: ")
    ]
    reach = sum(float(np.linalg.norm(joint.translation)) for joint, *_ in case.tree.bodies)
    for link in case.tree.links:
        mass, _, inertia = to_central(link.phi)
        if mass <= 0 or reach <= 0 or len(case.joints) == 1:
            continue
        radius = float(np.sqrt(max(np.trace(inertia), 0.0) / (2 * mass)))
        if radius > REACH * reach:
            found.append(
                CheckFinding(
                    "inertia",
                    link.name,
                    0.99,
                    f"link {link.name} of {mass:.3g} kg has the inertia of a body {radius:.3g} m wide, and the robot "
                    f"is {reach:.3g} m long: a unit such as kg·mm² is read as kg·m²",
                    'inertia = "free"',
                    fault=False,
                )
            )
    return found


KIND = Kind("inertia", "a link cannot have the mass properties given", find=find)
