"""Where the cables rest before the ring turns: the shape from which a simulation starts.

A cable that is straight when free of stress and may turn freely at its ends cannot rest as a helix: its bending moment
would end abruptly there. It springs to Euler's elastica between spherical joints, pressed by P along its chord:
θ″ = −(P/EI) sin θ with θ′ = 0 at both ends, so sin(θ/2) = k cd(λs | k²), λ = 2K(k²)/Ls = √(P/EI), k from the chord's
length. From there Newton's method finds the rest of the elements themselves, the least of their strain energy; else a
small misfit of axial strain would shake the cables at the start.
"""

from typing import cast

import casadi as ca
import numpy as np
from scipy.integrate import cumulative_simpson
from scipy.optimize import brentq
from scipy.special import ellipj, ellipk

from ...errors import InputError
from .cubic import first_weights, second_weights, third_weights
from .energy import BENDING_POINTS, TENSION_POINTS
from .geometry import N_CABLES, helices, ring_points
from .parameters import SnareParameters


def settled(parameters: SnareParameters, n_elements: int) -> np.ndarray:
    """Nodes of the three cables at rest between the rings, in the end effector's frame.

    Each bows in one plane through its chord, to the side of its helix.

    Returns
    -------
    array (3, n_elements + 1, 2, 3)
        Cable, node; position [m] and slope dr/ds; x, y, z.

    Raises
    ------
    InputError
        As `geometry.helices` does.
    """
    helix = helices(parameters, n_elements)
    ends = ring_points(parameters)
    chord = float(np.linalg.norm(ends[0, 1] - ends[0, 0]))
    plane = _rest(parameters, n_elements, _elastica(parameters, n_elements, chord))
    nodes = np.zeros_like(helix)
    for cable in range(N_CABLES):
        axis = (ends[cable, 1] - ends[cable, 0]) / chord
        bow = helix[cable, n_elements // 2, 0] - ends[cable].mean(axis=0)
        bow -= (bow @ axis) * axis
        bow /= np.linalg.norm(bow)
        nodes[cable] = plane @ np.array([axis, bow])
        nodes[cable, :, 0] += ends[cable, 0]
        nodes[cable, [0, -1], 0] = ends[cable]
    return nodes


def _elastica(parameters: SnareParameters, n_elements: int, chord: float) -> np.ndarray:
    """Nodes of the elastica in its plane, shape (n_nodes, 2, 2): position and slope; along the chord, across it."""
    per_element = 50
    stations = np.linspace(0.0, parameters.cable_length, per_element * n_elements + 1)

    def slopes(modulus: float) -> tuple[np.ndarray, np.ndarray]:
        rate = 2 * float(ellipk(modulus**2)) / parameters.cable_length
        _, cn, dn, _ = ellipj(rate * stations, modulus**2)
        half_sine = modulus * cn / dn
        cosine = 1 - 2 * half_sine**2
        stretch = 1 - parameters.bending_stiffness * rate**2 * cosine / parameters.axial_stiffness
        return stretch * cosine, stretch * 2 * half_sine * np.sqrt(1 - half_sine**2)

    def excess(modulus: float) -> float:
        return float(cumulative_simpson(slopes(modulus)[0], x=stations)[-1]) - chord

    if excess(1e-6) <= 0:
        raise InputError(
            f"snare: cable_length is {parameters.cable_length:g} m, too near its chord of {chord:.5g} m to bow; "
            "lengthen the cable"
        )
    modulus = cast(float, brentq(excess, 1e-6, 0.999, xtol=1e-14))
    along, across = slopes(modulus)
    nodes = np.empty((n_elements + 1, 2, 2))
    for axis, slope in enumerate((along, across)):
        nodes[:, 0, axis] = cumulative_simpson(slope, x=stations, initial=0.0)[::per_element]
        nodes[:, 1, axis] = slope[::per_element]
    nodes[-1, 0] = chord, 0.0
    return nodes


def _rest(parameters: SnareParameters, n_elements: int, guess: np.ndarray) -> np.ndarray:
    """Least strain energy of the elements in the plane, their end points held; shape as the guess."""
    size = parameters.cable_length / n_elements
    nodes = ca.SX.sym("nodes", 4 * (n_elements + 1))
    energy = ca.SX(0.0)
    for number in range(n_elements):
        element = ca.reshape(nodes[4 * number : 4 * number + 8], 2, 4)
        ea, ei = parameters.axial_stiffness, parameters.bending_stiffness
        square, change = (ca.sumsqr(element @ ca.vertcat(*n)) for n in (second_weights(0.5, size), third_weights(size)))
        mean = 0
        for x, weight in TENSION_POINTS.tolist():
            tangent = element @ ca.vertcat(*first_weights(x, size))
            strain = ca.norm_2(tangent) - 1 + parameters.prestrain
            mean += weight * strain
            energy += 0.5 * weight * size * parameters.axial_stiffness * strain**2
        soft, missing = ea * size**4 * square / (720 * ei), size**4 * (1.5 * change - 2 * square**2) / 1440
        energy += 0.5 * ea * size * ((mean - missing) ** 2 / (1 + soft) - mean**2)
        energy -= ei * size**5 * (12 * square * change - 10 * square**3) / 1440
        for x, weight in BENDING_POINTS.tolist():
            tangent = element @ ca.vertcat(*first_weights(x, size))
            bow = element @ ca.vertcat(*second_weights(x, size))
            curvature = (tangent[0] * bow[1] - tangent[1] * bow[0]) / ca.sumsqr(tangent)
            energy += 0.5 * weight * size * parameters.bending_stiffness * curvature**2
    hessian, gradient = ca.hessian(energy, nodes)
    evaluate = ca.Function("rest", [nodes], [hessian, gradient])
    free = np.setdiff1d(np.arange(4 * (n_elements + 1)), [0, 1, 4 * n_elements, 4 * n_elements + 1])
    values = guess.ravel().copy()
    for _ in range(20):
        stiffness, force = (np.array(result) for result in evaluate(values))
        change = np.linalg.solve(stiffness[np.ix_(free, free)], -force[free, 0])
        values[free] += change
        if np.max(np.abs(change)) < 1e-13:
            break
    return values.reshape(guess.shape)
