"""A control program: a Python function that is called at a fixed period, as the real one is by its computer."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import InputError
from ..participant import Participant, StepError, Variable

Function = Callable[[float, np.ndarray, np.ndarray, Mapping[str, float]], tuple[Any, Any]]
_EARLY = 1e-9  # a call due this close to the end of a step, in periods, is made


class Program(Participant):
    """Calls ``outputs, state = function(time, inputs, state, parameters)`` every period; outputs hold in between.

    Parameters
    ----------
    variables : sequence of Variable
        Inputs, outputs and parameters.
    function : callable
        Takes the time [s], inputs (n_inputs,), the state that it gave last (n_states,), and parameters by name; gives
        outputs (n_outputs,) and the new state. It must keep nothing for itself, so that steps can be repeated.
    period : float
        Between two calls [s]. The first is one period after the start; until then outputs have their start values.
    state : array_like (n_states,)
        At the start.
    name : str
    """

    can_restore = True

    def __init__(
        self,
        variables: Sequence[Variable],
        function: Function,
        period: float,
        state: Sequence[float] | np.ndarray = (),
        name: str = "program",
    ) -> None:
        """Check the period."""
        if not period > 0:
            raise InputError(f"{name}: period {period} s must be positive")
        self.name, self.variables = name, tuple(variables)
        self._function, self._period = function, float(period)
        self._first_state = np.array(state, dtype=float)

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """Back to the first state; raises InputError for an unknown parameter."""
        self._parameters = self.start_parameters(parameters)
        self._start, self._calls = time, 0
        self._state = self._first_state.copy()
        self._inputs = np.array([v.start for v in self.variables if v.causality == "input"])
        self._outputs = np.array([v.start for v in self.variables if v.causality == "output"])

    def set_inputs(self, values: np.ndarray) -> None:
        """Keep the inputs for the next call."""
        self._inputs = values.copy()

    def step(self, time: float, size: float) -> None:
        """Make the calls that are due by the end of the step."""
        while (due := self._start + (self._calls + 1) * self._period) <= time + size + _EARLY * self._period:
            outputs, state = self._function(due, self._inputs, self._state, self._parameters)
            self._outputs, self._state = np.array(outputs, dtype=float).ravel(), np.array(state, dtype=float).ravel()
            if len(self._outputs) != len(self.names("output")):
                raise StepError(
                    f"{self.name}: the function gave {len(self._outputs)} outputs at {due:.9g} s, "
                    f"{len(self.names('output'))} are declared; mend the function"
                )
            self._calls += 1

    def outputs(self) -> np.ndarray:
        """Outputs of the last call."""
        return self._outputs.copy()

    def save(self) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
        """Number of calls, inputs, state and outputs."""
        return self._calls, self._inputs.copy(), self._state.copy(), self._outputs.copy()

    def restore(self, state: tuple[int, np.ndarray, np.ndarray, np.ndarray]) -> None:
        """Back to a saved state."""
        self._calls, (self._inputs, self._state, self._outputs) = state[0], (part.copy() for part in state[1:])
