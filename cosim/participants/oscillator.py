"""Two halves of a chain of two masses: the smallest system that shows the coupling's error in a co-simulation.

Each half is a mass on a spring and damper to the ground. A third spring and damper joins the masses; it belongs to the
right half, which reads the left mass's position and speed and answers with the force between them::

    ground --k1,d1-- [m1] --kc,dc-- [m2] --k2,d2-- ground
           left half    |   right half

    m1 a1 = -k1 x1 - d1 v1 + F          left: force in, motion out
    m2 a2 = -k2 x2 - d2 v2 - F          right: motion in, force out
    F = kc (x2 - x1) + dc (v2 - v1)

This is the usual linear test model of co-simulation, in force-displacement form (Schweizer, Li, Lu 2015, Explicit and
implicit cosimulation methods: stability and convergence analysis for different solver coupling approaches,
J. Comput. Nonlinear Dynam. 10).
"""

from abc import abstractmethod
from collections.abc import Mapping

import numpy as np

from ..participant import Participant, Variable


class _LinearHalf(Participant):
    """x' = A x + B u by the classical Runge-Kutta method of order 4; the input's polynomial is a state too.

    Parameters
    ----------
    name : str
    substeps : int
        Runge-Kutta steps in a macro step.
    """

    can_restore = True
    input_order = 2

    def __init__(self, name: str = "", substeps: int = 1) -> None:
        """A half under its own name."""
        self._substeps = substeps
        self.name = name or type(self).__name__.lower()
        self._maps: dict[float, np.ndarray] = {}

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """Put the mass at its starting position and speed."""
        values = self.start_parameters(parameters)
        self._state, self._input, self._output = self._equations(values)
        n, m = self._input.shape
        self._x = np.zeros(n + 3 * m)
        self._x[:2] = values["position"], values["speed"]
        self._n, self._m = n, m
        self._maps.clear()

    @abstractmethod
    def _equations(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A (n, n), B (n, m) and the outputs' matrix on state and input (n_outputs, n + m)."""

    def set_inputs(self, values: np.ndarray) -> None:
        """Hold the inputs, without a slope."""
        self._x[self._n : self._n + self._m] = values
        self._x[self._n + self._m :] = 0.0

    def set_input_derivatives(self, first: np.ndarray, second: np.ndarray) -> None:
        """Let the inputs move along a parabola during the step."""
        self._x[self._n + self._m : self._n + 2 * self._m] = first
        self._x[self._n + 2 * self._m :] = second

    def step(self, time: float, size: float) -> None:
        """The Runge-Kutta steps, in one product."""
        if size not in self._maps:
            self._maps[size] = np.linalg.matrix_power(self._runge_kutta(size / self._substeps), self._substeps)
        self._x = self._maps[size] @ self._x

    def outputs(self) -> np.ndarray:
        """The outputs, from the state and the inputs now."""
        return self._output @ self._x[: self._n + self._m]

    def save(self) -> np.ndarray:
        """State and inputs."""
        return self._x.copy()

    def restore(self, state: np.ndarray) -> None:
        """Back to a saved state."""
        self._x = state.copy()

    def _runge_kutta(self, size: float) -> np.ndarray:
        """The step of a linear system: exp(hA) up to its fourth power, which is the classical method on x' = A x."""
        n, m = self._n, self._m
        a = np.zeros((n + 3 * m, n + 3 * m))
        a[:n, :n], a[:n, n : n + m] = self._state, self._input
        a[n : n + 2 * m, n + m :] = np.eye(2 * m)
        identity = np.eye(len(a))
        return identity + size * a @ (identity + size / 2 * a @ (identity + size / 3 * a @ (identity + size / 4 * a)))


def _parameters(spring: float, position: float) -> tuple[Variable, ...]:
    return (
        Variable("mass", "parameter", "kg", 1.0, "mass", minimum=1e-12),
        Variable("stiffness", "parameter", "N/m", spring, "spring to the ground", minimum=0.0),
        Variable("damping", "parameter", "N*s/m", 0.0, "damper to the ground", minimum=0.0),
        Variable("position", "parameter", "m", position, "position at the start"),
        Variable("speed", "parameter", "m/s", 0.0, "speed at the start"),
    )


class LeftOscillator(_LinearHalf):
    """The mass that is pushed by a force and shows how it moves."""

    variables = (
        *_parameters(10.0, 1.0),
        Variable("force", "input", "N", description="on the mass, along x"),
        Variable("x", "output", "m", 1.0, "position"),
        Variable("v", "output", "m/s", 0.0, "speed"),
    )

    def _equations(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        mass = values["mass"]
        state = np.array([[0.0, 1.0], [-values["stiffness"] / mass, -values["damping"] / mass]])
        return state, np.array([[0.0], [1.0 / mass]]), np.eye(2, 3)


class RightOscillator(_LinearHalf):
    """The mass that is moved at the far end of a coupling spring, and shows the spring's force."""

    variables = (
        *_parameters(10.0, 0.0),
        Variable("coupling_stiffness", "parameter", "N/m", 3.0, "spring between the masses", minimum=0.0),
        Variable("coupling_damping", "parameter", "N*s/m", 0.0, "damper between the masses", minimum=0.0),
        Variable("x_left", "input", "m", description="position of the left mass"),
        Variable("v_left", "input", "m/s", description="speed of the left mass"),
        Variable("x", "output", "m", 0.0, "position"),
        Variable("v", "output", "m/s", 0.0, "speed"),
        Variable("force", "output", "N", 0.0, "on the left mass, along x", depends=("x_left", "v_left")),
    )

    def _equations(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        mass, k, d = values["mass"], values["coupling_stiffness"], values["coupling_damping"]
        own = [-(values["stiffness"] + k) / mass, -(values["damping"] + d) / mass]
        state = np.array([[0.0, 1.0], own])
        return state, np.array([[0.0, 0.0], [k / mass, d / mass]]), np.vstack([np.eye(2, 4), [k, d, -k, -d]])
