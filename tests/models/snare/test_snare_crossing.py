"""Cables that cross beyond 80°: they hold each other off, and the ledger of energy still closes."""

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from snarelab.models.snare.model import SnareModel
from snarelab.models.snare.parameters import SnareParameters, wall_length
from snarelab.models.snare.target import Target

FAR = Target("spring", position=(0.6, 0.0, 0.0))
"""Out of the cables' reach."""


def gap(model):
    """Smallest distance of two cables' centre lines [m], from points 1 mm apart on their cubics."""
    a = model.assembly
    coordinates = a.system.systemData.GetODE2Coordinates()[: a.n_cable_coordinates] + a.nodes.ravel()
    s = np.linspace(0, a.parameters.cable_length, a.n_elements + 1)
    fine = np.linspace(0, s[-1], 300)
    lines = [CubicHermiteSpline(s, c[:, 0], c[:, 1])(fine) for c in coordinates.reshape(3, -1, 2, 3)]
    return min(np.linalg.norm(lines[i][:, None] - lines[j], axis=2).min() for i, j in ((0, 1), (1, 2), (0, 2)))


def test_cables_that_cross_hold_each_other_off():
    """Rings 30 mm apart: the cables touch from about 96° on, and would cut through each other by 110°."""
    quick = SnareParameters(
        ring_distance=0.03, cable_length=wall_length(0.127, 0.03), ring_rate=0.4, ring_travel=np.deg2rad(110.0)
    )
    model = SnareModel(quick, FAR)
    history = model.run(5.0, every=0.05)
    assert np.rad2deg(history.ring_angle[-1]) > 109.9
    before = history.energies["overlap"][history.ring_angle < np.deg2rad(80.0)]
    assert np.all(before == 0)
    assert history.energies["overlap"][-1] > 1e-4
    diameter = quick.cable_diameter
    assert diameter - 1e-4 < gap(model) < diameter + 1e-5  # they touch, and give by less than 0.1 mm
    work = history.energies["ring_work"]
    assert np.abs(history.energy_residual).max() < 5e-3 * np.ptp(work)
