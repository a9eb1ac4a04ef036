"""A participant of a co-simulation, in FMI's terms: variables, initialise, set, step, get, save, restore.

A participant is one file in ``cosim/participants`` with a subclass of `Participant`. Inputs are one vector and
outputs another, in the order of `Participant.variables`, so that the master's loop is a few array copies. Parameters
are given once, by name, at initialisation.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from ..errors import InputError, nearest

Causality = Literal["input", "output", "parameter"]


@dataclass(frozen=True)
class Variable:
    """One scalar variable of a participant.

    Parameters
    ----------
    name : str
        Unique in the participant; a recording's column name where one fits (``q.joint1``, ``pos.pin.x``).
    causality : "input", "output" or "parameter"
    unit : str
        pint's spelling (``N*m``, ``rad/s``); ``1`` for a plain number, empty where it is not stated.
    start : float
        Value before the first step (inputs), default (parameters), or what `Participant.outputs` gives at first.
    description : str
        What it is, with its frame, in a few words.
    minimum, maximum : float
        Bounds [unit].
    depends : tuple of str or None
        For an output: the inputs that change it without a step (direct feedthrough). Empty: none.
        None: unknown; the master then moves each input at the start and looks.
    discrete : bool
        For an output: it is constant between jumps, as a command is. An input that reads it gets the value at the
        start of each step, never a line or parabola through the jumps.
    """

    name: str
    causality: Causality
    unit: str
    start: float = 0.0
    description: str = ""
    minimum: float = -np.inf
    maximum: float = np.inf
    depends: tuple[str, ...] | None = ()
    discrete: bool = False


class Participant(ABC):
    """A simulation that advances by macro steps.

    Life: construct, `initialize` once, then `set_inputs`, `step`, `outputs` again and again, then `close`.
    ``state = save()`` and ``restore(state)`` give exactly the same future, bit for bit, also in another instance of the
    same participant; `can_restore` says whether the two methods exist. A step that fails raises `StepError` and leaves
    the participant so that `restore` still works. `input_order` is how many derivatives of the inputs a step follows,
    `can_halve` whether it takes other inputs for the second half of a step, `can_vary_step` whether steps may differ in
    size. `start_limit` is the time [s] that `initialize` has at least, however short a step's timeout is. `unread` has
    the inputs that are no numbers, with their type: they keep their start values.
    """

    name: str
    variables: tuple[Variable, ...]
    can_restore: bool = False
    input_order: int = 0
    can_halve: bool = False
    can_vary_step: bool = True
    start_limit: float = 60.0
    unread: Mapping[str, str] = MappingProxyType({})

    @abstractmethod
    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """Build the model at a time [s] with parameters by name; raises InputError for an unknown one."""

    @abstractmethod
    def set_inputs(self, values: np.ndarray) -> None:
        """Take every input, shape (n_inputs,), in the order of ``variables``."""

    @abstractmethod
    def step(self, time: float, size: float) -> None:
        """Advance from ``time`` by ``size`` [s] with the inputs held; raises `StepError`."""

    def set_input_derivatives(self, first: np.ndarray, second: np.ndarray) -> None:
        """Derivatives of every input at the start of the step [unit/s, unit/s²], each shape (n_inputs,).

        Called after each `set_inputs` where `input_order` is 1 (``second`` is then zero) or 2, and then only. Where it
        is not called after one, inputs are those of the step's middle.
        """
        raise NotImplementedError(f"{self.name}: takes no input derivatives")  # optional: given if `input_order` > 0

    def set_input_halves(self, first: np.ndarray, second: np.ndarray) -> None:
        """Every input over the first and over the second half of the next step, in place of `set_inputs`."""
        raise NotImplementedError(f"{self.name}: takes no inputs by halves")  # optional: given if `can_halve`

    def begin(self, time: float, size: float) -> None:
        """Start a step that `finish` waits for; the default takes the whole step here, as nothing runs beside it."""
        self.step(time, size)

    def finish(self) -> None:  # noqa: B027  nothing is left to wait for unless `begin` is overridden
        """Wait for the step that `begin` started; raises `StepError`."""

    @abstractmethod
    def outputs(self) -> np.ndarray:
        """Every output now, shape (n_outputs,), in the order of ``variables``."""

    def save(self) -> Any:
        """The complete state; to be treated as opaque."""
        raise NotImplementedError(f"{self.name}: cannot save its state")  # optional: asked only if `can_restore`

    def restore(self, state: Any) -> None:
        """Return to a saved state, exactly."""
        raise NotImplementedError(f"{self.name}: cannot restore a state")  # optional: asked only if `can_restore`

    def next_event(self, time: float) -> float:
        """Time [s] of the next jump after a time [s]; no macro step goes past it. Infinity: none."""
        return math.inf

    def events(self) -> tuple[str, ...]:
        """Events of the last step for the log, a line each; called once after each accepted step."""
        return ()

    def compiled_calls(self) -> Any:
        """What `snarelab.cosim.compiled_loop` needs to call the participant from C; None if only Python can call it."""
        return None

    def close(self) -> None:  # noqa: B027  most participants hold nothing to give back
        """Release processes, files and memory; no call follows."""

    def start_parameters(self, given: Mapping[str, float] | None) -> dict[str, float]:
        """Every parameter's start value, or the one given; InputError for one that it does not have."""
        values = {v.name: v.start for v in self.variables if v.causality == "parameter"}
        for key in given or ():
            if key not in values:
                raise InputError(f"{self.name}: has no parameter {key!r}; nearest is {nearest(key, values)!r}")
        return values | dict(given or {})

    def names(self, causality: Causality) -> tuple[str, ...]:
        """Names of the variables of one causality, in order."""
        return tuple(v.name for v in self.variables if v.causality == causality)


class StepError(RuntimeError):
    """A step that could not be taken: participant, time, reason and mend in one line."""
