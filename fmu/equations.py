"""A model in an FMU: variables, and CasADi functions of elapsed time, states, inputs and parameters.

Letters: t time since the start [s], x states, u inputs, p parameters, y outputs. A model is one of two kinds:

- *free*: ``rate(t, x, u, p) -> x'`` is integrated;
- *following* a given motion: ``advance(t, h, x, u_before, u, p) -> x`` a step h later, from the inputs at both ends.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import casadi as ca
import numpy as np

from ..errors import InputError


@dataclass(frozen=True)
class ModelVariable:
    """One scalar of an FMU.

    Parameters
    ----------
    name : str
    causality : "input", "parameter" or "output"
    unit : str
        pint's spelling (``N*m``, ``rad/s``); ``1`` for a plain number.
    start : float
        Value before the first step (inputs) or default (parameters).
    description : str
    minimum, maximum : float
        Bounds [unit]; infinite where there are none.
    fixed : bool
        Parameters only: cannot be changed once initialization has ended.
    depends : tuple of str or None
        For an output: the inputs that change it at once. None: unknown, which counts as all.
    refuses : bool
        Parameters only: whether values out of bounds are refused, or the bounds are for the importer's information.
    """

    name: str
    causality: Literal["input", "parameter", "output"]
    unit: str
    start: float = 0.0
    description: str = ""
    minimum: float = -np.inf
    maximum: float = np.inf
    fixed: bool = False
    depends: tuple[str, ...] | None = ()
    refuses: bool = True


@dataclass(frozen=True, eq=False)
class Equations:
    """A model ready to be written as C.

    Parameters
    ----------
    name : str
        A C identifier.
    description : str
        One sentence.
    variables : tuple of ModelVariable
        Inputs, then parameters, then outputs.
    functions : mapping of str to casadi.Function
        ``initial`` (t, u, p), ``output`` (t, x, u, p), ``derivative`` (t, x, u, p, du, dp) and ``rate`` or ``advance``;
        ``jacobian`` where the model is stiff.
    n_states : int
    """

    name: str
    description: str
    variables: tuple[ModelVariable, ...]
    functions: Mapping[str, ca.Function]
    n_states: int

    @property
    def follows(self) -> bool:
        """Whether a given motion is followed."""
        return "advance" in self.functions

    @property
    def stiff(self) -> bool:
        """Whether the integrator is linearly implicit and error-controlled, or explicit with fixed steps."""
        return "jacobian" in self.functions

    def of(self, causality: str) -> tuple[ModelVariable, ...]:
        """Variables of one causality, in order."""
        return tuple(v for v in self.variables if v.causality == causality)

    def starts(self, causality: str) -> np.ndarray:
        """Start values of one causality, in order."""
        return np.array([v.start for v in self.of(causality)])


@dataclass
class Ledger:
    """Collects a model's variables and states while its equations are built."""

    time: ca.SX = field(default_factory=lambda: ca.SX.sym("t"))
    _inputs: list[tuple[ModelVariable, ca.SX]] = field(default_factory=list)
    _parameters: list[tuple[ModelVariable, ca.SX]] = field(default_factory=list)
    _outputs: list[tuple[ModelVariable, ca.SX]] = field(default_factory=list)
    _states: list[ca.SX] = field(default_factory=list)
    _initial: list[ca.SX] = field(default_factory=list)

    def input(self, name: str, unit: str, description: str, start: float = 0.0) -> ca.SX:
        """A new input and its symbol."""
        return self._added(self._inputs, ModelVariable(name, "input", unit, start, description))

    def parameter(
        self,
        name: str,
        unit: str,
        start: float,
        description: str,
        bounds: tuple[float, float] = (-np.inf, np.inf),
        fixed: bool = False,
    ) -> ca.SX:
        """A new parameter and its symbol; bounds that do not hold the start are left out.

        A fixed one says where the motion starts: beyond a joint's limits, the model's equations hold as well.
        """
        low, high = bounds if bounds[0] <= start <= bounds[1] else (-np.inf, np.inf)
        made = ModelVariable(name, "parameter", unit, start, description, low, high, fixed, refuses=not fixed)
        return self._added(self._parameters, made)

    def output(self, name: str, unit: str, expression: ca.SX, description: str) -> None:
        """A new output."""
        self._outputs.append((ModelVariable(name, "output", unit, 0.0, description), expression))

    def vector(self, name: str, unit: str, expression: ca.SX, description: str, axes: str = "xyz") -> None:
        """Outputs ``name.x``, ``name.y``, ...."""
        for axis, component in zip(axes, ca.vertsplit(expression), strict=True):
            self.output(f"{name}.{axis}", unit, component, f"{description}, {axis}")

    def vector_input(self, name: str, unit: str, description: str) -> ca.SX:
        """Inputs ``name.x``, ``name.y``, ``name.z``."""
        return ca.vertcat(*(self.input(f"{name}.{axis}", unit, f"{description}, {axis}") for axis in "xyz"))

    def state(self, initial: ca.SX | float = 0.0) -> ca.SX:
        """A new state, with its value at the start as a function of inputs and parameters."""
        symbol = ca.SX.sym(f"x{len(self._states)}")
        self._states.append(symbol)
        self._initial.append(ca.SX(initial))
        return symbol

    def parameters(self) -> tuple[ca.SX, np.ndarray]:
        """Symbols of all parameters so far, and their starts."""
        return _column(self._parameters), np.array([v.start for v, _ in self._parameters])

    def inputs(self) -> ca.SX:
        """Symbols of all inputs so far."""
        return _column(self._inputs)

    def fastest(self, rates: list[ca.SX], changes: Mapping[int, float]) -> float:
        """Largest rate [1/s] of the model linearised at its start, with some states changed; infinite if undefined."""
        u, (p, starts) = self.inputs(), self.parameters()
        rest = np.zeros(u.numel())
        x, first = _stacked(self._states), _stacked(self._initial)
        state = np.array(ca.Function("first", [self.time, u, p], [first])(0, rest, starts)).ravel()
        state[list(changes)] = list(changes.values())
        slope = ca.Function("slope", [self.time, x, u, p], [ca.jacobian(ca.vertcat(*rates), x)])
        matrix = np.array(slope(0, state, rest, starts))
        return float(np.abs(np.linalg.eigvals(matrix)).max()) if np.isfinite(matrix).all() else np.inf

    def equations(self, name: str, description: str, rates: list[ca.SX], stiff: bool) -> Equations:
        """The free model; the rates in the order of the states. Adds the integrator's own parameter."""
        if stiff:
            words = "largest local error of an internal step, relative to the greater of 1 and each state"
            self.parameter("solver.tolerance", "1", 1e-8, words, (1e-12, 1e-2))
        else:
            self.parameter("solver.step", "s", 1e-3, "largest internal step (Runge-Kutta, order 4)", (1e-7, 1.0))
        t, x, u, p = self.time, _stacked(self._states), self.inputs(), _column(self._parameters)
        rate = _stacked(rates)
        functions = {"rate": _function("rate", [t, x, u, p], rate)}
        if stiff:
            functions["jacobian"] = _function("jacobian", [t, x, u, p], ca.densify(ca.jacobian(rate, x)))
        return self._finished(name, description, functions)

    def following(self, name: str, description: str, advance: ca.Function) -> Equations:
        """The model that follows a motion; ``advance(t, h, x, u_before, u, p)``."""
        return self._finished(name, description, {"advance": advance})

    def _finished(self, name: str, description: str, functions: dict[str, ca.Function]) -> Equations:
        t, x, u, p = self.time, _stacked(self._states), self.inputs(), _column(self._parameters)
        y = ca.vertcat(*(expression for _, expression in self._outputs))
        du, dp = ca.SX.sym("du", u.numel()), ca.SX.sym("dp", p.numel())
        functions |= {
            "initial": _function("initial", [t, u, p], _stacked(self._initial)),
            "output": _function("output", [t, x, u, p], y),
            "derivative": _function(
                "derivative", [t, x, u, p, du, dp], ca.jtimes(y, ca.vertcat(u, p), ca.vertcat(du, dp))
            ),
        }
        inputs = [variable for variable, _ in self._inputs]
        reach = np.array(ca.DM(ca.jacobian_sparsity(y, u), 1).full(), bool).reshape(y.numel(), u.numel())
        outputs = [
            replace(variable, depends=tuple(v.name for v, hit in zip(inputs, row, strict=True) if hit))
            for (variable, _), row in zip(self._outputs, reach, strict=True)
        ]
        variables = (*inputs, *(variable for variable, _ in self._parameters), *outputs)
        names = [v.name for v in variables]
        for twice in {n for n in names if names.count(n) > 1}:
            raise InputError(f"{name}: two variables would be called {twice!r}; rename the joint or link")
        return Equations(name, description, variables, functions, x.numel())

    def _added(self, where: list[tuple[ModelVariable, ca.SX]], variable: ModelVariable) -> ca.SX:
        symbol = ca.SX.sym(variable.name)
        where.append((variable, symbol))
        return symbol


def _column(entries: list[tuple[ModelVariable, ca.SX]]) -> ca.SX:
    return _stacked([symbol for _, symbol in entries])


def _stacked(parts: list[ca.SX]) -> ca.SX:
    return ca.vertcat(*parts) if parts else ca.SX(0, 1)


def _function(name: str, inputs: list[ca.SX], expression: ca.SX) -> ca.Function:
    return ca.Function(f"model_{name}", inputs, [ca.cse(ca.densify(expression))])
