"""The cable against closed forms, at the default ten elements: bent, hanging, vibrating, and turned as a whole."""

# pyright: reportArgumentType=false, reportCallIssue=false, reportOperatorIssue=false, reportAttributeAccessIssue=false

import warnings
from math import pi, sqrt

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from snarelab.models.exudyn_build import exudyn, items
from snarelab.models.snare.assembly import add_cable
from snarelab.models.snare.drive import Pose
from snarelab.models.snare.model import Accuracy, SnareModel
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.target import Target

N_ELEMENTS = 10


def straight_cable(parameters, held):
    """A system with one cable along x; `held` lists (node, coordinate) that are fixed."""
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    nodes = np.zeros((N_ELEMENTS + 1, 2, 3))
    nodes[:, 0, 0] = np.linspace(0, parameters.cable_length, N_ELEMENTS + 1)
    nodes[:, 1, 0] = 1.0
    numbers = add_cable(system, nodes, parameters)
    ground = system.AddMarker(
        items.MarkerNodeCoordinate(nodeNumber=system.AddNode(items.NodePointGround()), coordinate=0)
    )
    for node, coordinate in held:
        marker = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=numbers[node], coordinate=coordinate))
        system.AddObject(items.CoordinateConstraint(markerNumbers=[ground, marker]))
    return container, system, numbers


def settle(system, steps, relative=1e-9):
    """Static equilibrium with the load applied in steps; shape (n_nodes, 2, 3)."""
    settings = exudyn.SimulationSettings()
    settings.solution.file.write = False
    settings.staticSolver.numberOfLoadSteps = steps
    settings.staticSolver.verboseMode = 0
    settings.staticSolver.newton.relativeTolerance = relative
    settings.staticSolver.newton.absoluteTolerance = 1e-9
    settings.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
    system.SolveStatic(settings)
    data = system.systemData
    total = data.GetODE2Coordinates() + data.GetODE2Coordinates(exudyn.ConfigurationType.Reference)
    return total.reshape(-1, 2, 3)


def test_cantilever_bends_as_the_elastica():
    """Tip load with PL²/EI = 10, a fall of 0.811 L; closed form by elliptic integrals (Bisshopp and Drucker 1945)."""
    p = SnareParameters(cable_length=1.0, cable_diameter=0.01)  # thin against its length: the form has no stretch
    load = 10 * p.bending_stiffness
    container, system, numbers = straight_cable(p, [(0, k) for k in (0, 1, 2, 4, 5)])
    tip = system.AddMarker(items.MarkerNodePosition(nodeNumber=numbers[-1]))
    system.AddLoad(items.LoadForceVector(markerNumber=tip, loadVector=[0, 0, -load]))
    system.Assemble()
    found = settle(system, 20)[-1, 0]

    def amplitude(k):
        return ellipk(k**2) - ellipkinc(np.arcsin(1 / (k * sqrt(2))), k**2) - sqrt(10)

    k = brentq(amplitude, 0.70711, 0.99999)
    start = np.arcsin(1 / (k * sqrt(2)))
    fall = 1 - 2 * (ellipe(k**2) - ellipeinc(start, k**2)) / sqrt(10)
    reach = sqrt(2 * (2 * k**2 - 1)) / sqrt(10)
    assert -found[2] == pytest.approx(fall, abs=2e-4)
    assert found[0] == pytest.approx(reach, abs=2e-4)
    assert container is not None


def test_hanging_cable_is_a_catenary():
    """A cable 10 % longer than its span, too slack and long to feel its bending stiffness."""
    p = SnareParameters(cable_length=1.0, cable_diameter=1e-4)
    span, strength = 1 / 1.1, 9.81
    container, system, numbers = straight_cable(p, [(0, k) for k in (0, 1, 2)] + [(N_ELEMENTS, k) for k in (1, 2)])
    end = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=numbers[-1], coordinate=0))
    ground = system.AddMarker(
        items.MarkerNodeCoordinate(nodeNumber=system.AddNode(items.NodePointGround()), coordinate=0)
    )

    def closing(_system, time, _item, _offset):
        return time * (span - p.cable_length)

    system.AddObject(items.CoordinateConstraint(markerNumbers=[ground, end], offset=1.0, offsetUserFunction=closing))
    for cable_object in range(N_ELEMENTS):
        weight = system.AddMarker(items.MarkerBodyMass(bodyNumber=cable_object))
        system.AddLoad(items.LoadMassProportional(markerNumber=weight, loadVector=[0, 0, -strength]))
    system.Assemble()
    shape = settle(system, 60)
    scale = brentq(lambda a: 2 * a * np.sinh(span / (2 * a)) - p.cable_length, 0.05, 10.0)
    sag = scale * (np.cosh(span / (2 * scale)) - 1)
    assert -shape[N_ELEMENTS // 2, 0, 2] == pytest.approx(sag, abs=3e-4 * p.cable_length)
    assert container is not None


def test_pinned_beam_vibrates_at_its_closed_form():
    """ω_n = (nπ/L)² √(EI/ρA), thin enough that stretch does not couple."""
    p = SnareParameters(cable_length=1.0, cable_diameter=0.002)
    held = [(node, k) for node in range(N_ELEMENTS + 1) for k in (1, 4)]  # one plane
    held += [(0, 0), (0, 2), (N_ELEMENTS, 2)]
    container, system, _ = straight_cable(p, held)
    system.Assemble()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        values, _ = system.ComputeODE2Eigenvalues(computeComplexEigenvalues=False, useAbsoluteValues=True)
    found = np.sort(np.sqrt(np.abs(values)))
    found = found[found > 1.0]
    for mode, tolerance in ((1, 1e-4), (3, 1e-3), (5, 5e-3)):
        exact = (mode * pi / p.cable_length) ** 2 * sqrt(p.bending_stiffness / p.mass_per_length)
        nearest = found[np.argmin(np.abs(found - exact))]
        assert nearest == pytest.approx(exact, rel=tolerance)
    assert container is not None


def test_a_rigid_turn_of_the_whole_snare_gives_no_acceleration():
    """At rest, turned by 80° and moved: accelerations stay at rounding of EA (2.5e5 N over grams)."""
    turn = np.deg2rad(80) * np.array([2.0, -1.0, 2.0]) / 3
    angle = np.linalg.norm(turn)
    x, y, z = turn / angle
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation = np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
    p = SnareParameters(ring_rate=1e-9)
    quaternion = [np.cos(angle / 2), *(np.sin(angle / 2) * turn / angle)]
    effector = Pose(np.array([3.0, -2.0, 1.0]), rotation, np.zeros(3), np.zeros(3))
    target = Target("moved", position=effector.position + rotation @ [0.2369, 0, 0], orientation=quaternion)
    model = SnareModel(p, target, Accuracy(1e-3, 10, 1e-3), effector)
    model.step(0.01)
    accelerations = model.assembly.system.systemData.GetODE2Coordinates_tt()
    # ten steps of 1 ms from rest; a form that is not frame-indifferent gave 6.8e5 m/s²
    assert np.max(np.abs(accelerations)) < 1e-2
    pin, root = model.wrenches()
    assert np.max(np.abs(pin)) == 0
    assert np.max(np.abs(root)) < 1e-4
