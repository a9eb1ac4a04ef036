"""A participant without a state: its outputs follow its inputs without a step."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..participant import Participant, StepError, Variable


class Formula(Participant):
    """``outputs = function(inputs, parameters)``: a contact law, a spring between two bodies, a change of frame.

    Parameters
    ----------
    variables : sequence of Variable
        Inputs, outputs and parameters. What an output ``depends`` on decides in which order the master asks.
    function : callable
        Takes inputs (n_inputs,) and parameters by name; gives outputs (n_outputs,). It must keep nothing for itself.
    name : str
    """

    can_restore = True

    def __init__(
        self,
        variables: Sequence[Variable],
        function: Callable[[np.ndarray, Mapping[str, float]], Any],
        name: str = "formula",
    ) -> None:
        """Nothing runs yet."""
        self.name, self.variables, self._function = name, tuple(variables), function

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """Inputs at their start values; raises InputError for an unknown parameter."""
        self._parameters = self.start_parameters(parameters)
        self._inputs = np.array([v.start for v in self.variables if v.causality == "input"])
        self._n_outputs = len(self.names("output"))

    def set_inputs(self, values: np.ndarray) -> None:
        """Take the inputs."""
        self._inputs = values.copy()

    def step(self, time: float, size: float) -> None:
        """Nothing moves by itself."""

    def outputs(self) -> np.ndarray:
        """The function of the inputs now."""
        values = np.array(self._function(self._inputs, self._parameters), dtype=float).ravel()
        if len(values) != self._n_outputs:
            raise StepError(
                f"{self.name}: the function gave {len(values)} outputs, {self._n_outputs} are declared; mend it"
            )
        return values

    def save(self) -> np.ndarray:
        """The inputs."""
        return self._inputs.copy()

    def restore(self, state: np.ndarray) -> None:
        """Back to saved inputs."""
        self._inputs = state.copy()
