"""Exudyn's implicit solver, kept open between macro steps, with exact save and restore.

Generalised-α (Chung and Hulbert 1993; constraints at position level) with modified Newton. The solver is initialised
once; each macro step only moves its end time on. The system's own state lacks accelerations, the algorithmic
accelerations of generalised-α, and time: `save` takes them all, `restore` puts each where the solver reads it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..exudyn_build import exudyn

_CURRENT = exudyn.ConfigurationType.Current
_INITIAL = exudyn.ConfigurationType.Initial


@dataclass(frozen=True)
class SolverState:
    """Everything that decides the solver's future: vectors of the system, and time [s]."""

    vectors: tuple[np.ndarray, ...]
    accelerations: np.ndarray
    algorithmic: np.ndarray
    time: float


class SnareSolver:
    """Steps an assembled system.

    Parameters
    ----------
    system : exudyn.MainSystem
        Assembled.
    time : float
        Where it starts [s].
    after_step : callable
        Called with the time after each accepted step, and once more at the start of each macro step.
    """

    def __init__(self, system: Any, time: float, after_step: Callable[[float], None]) -> None:
        """Initialise the solver."""
        self.system = system
        self._data = system.systemData
        self._settings = exudyn.SimulationSettings()
        s = self._settings.timeIntegration
        s.startTime, s.endTime, s.numberOfSteps = time, time + 1.0, 1
        s.generalizedAlpha.spectralRadius = 0.8
        s.adaptiveStep = True
        s.minimumStepSize = 1e-7
        s.verboseMode = 0
        s.newton.relativeTolerance = 1e-6
        s.newton.absoluteTolerance = 1e-6
        self._settings.solution.file.write = False
        self._settings.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
        self._settings.parallel.numberOfThreads = 1

        def finished(_system: Any, now: float) -> bool:
            after_step(now)
            return True

        system.SetPostStepUserFunction(finished)
        self._solver: Any = exudyn.MainSolverImplicitSecondOrder()  # its stubs lack self
        self._solver.InitializeSolver(system, self._settings)
        # From now on the solver is only re-initialised to restore a state, accelerations included.
        s.generalizedAlpha.computeInitialAccelerations = False
        s.generalizedAlpha.resetAccelerations = False

    @property
    def time(self) -> float:
        """Where it stands [s]."""
        return self._solver.it.currentTime

    def advance(self, size: float, step: float) -> bool:
        """Take a macro step of `size` in equal steps of `step` at most [s]; False where it did not converge."""
        it = self._solver.it
        start = it.currentTime
        it.startTime = start
        it.endTime = start + size
        it.maxStepSize = size / np.ceil(size / step * (1 - 1e-9))
        try:
            return bool(self._solver.SolveSteps(self.system, self._settings))
        except (RuntimeError, ValueError, exudyn.SolverError):
            return False

    def save(self) -> SolverState:
        """Copies of everything that decides the future."""
        return SolverState(
            tuple(self._data.GetSystemState(_CURRENT)),
            self._data.GetODE2Coordinates_tt(_CURRENT),
            self._solver.GetAAlgorithmic(),
            self._solver.it.currentTime,
        )

    def restore(self, state: SolverState) -> None:
        """Return to a saved state, bit for bit."""
        data, vectors = self._data, list(state.vectors)
        # The solver copies Initial to Current and takes the algorithmic accelerations from its accelerations.
        data.SetSystemState(vectors, _INITIAL)
        data.SetODE2Coordinates_tt(state.algorithmic, _INITIAL)
        self._settings.timeIntegration.startTime = state.time
        self._settings.timeIntegration.endTime = state.time + 1.0
        self._solver.InitializeSolverInitialConditions(self.system, self._settings)
        data.SetSystemState(vectors, _CURRENT)
        data.SetODE2Coordinates_tt(state.accelerations, _CURRENT)
        data.SetTime(state.time, _CURRENT)
        self._solver.it.currentTime = state.time
