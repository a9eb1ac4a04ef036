"""The co-simulation master: macro steps up to a time, and their record.

``jacobi`` steps all participants at once, on the outputs at the start of the macro step. ``gauss_seidel`` steps them
one after another, each on the newest outputs of the earlier ones (`snarelab.cosim.sweep`). Either is explicit, or
is iterated, or is repeated smaller (`snarelab.cosim.macro_step`).
"""

import math
from collections.abc import Callable
from types import TracebackType
from typing import Literal, Self

import numpy as np

from ..errors import InputError, nearest
from .compiled_loop import CompiledLoop, compiled_loop
from .energy import BondEnergy
from .feedthrough import FeedThrough
from .hold import hold_named
from .iteration import Iteration
from .macro_step import MacroStep
from .participant import Participant, StepError
from .record import Event, Record, Run
from .step_control import StepControl
from .sweep import Sweep
from .system import System

Scheme = Literal["jacobi", "gauss_seidel"]
HoldName = Literal["constant", "linear", "quadratic", "midpoint"]
_AT_ONCE = 2000  # compiled steps between two looks at the keyboard
_SAME = 1e-9  # a step that ends this close to the goal, in steps, ends there


class Master:
    """Runs a system; `step` by step, or `run` to a time.

    Parameters
    ----------
    system : System
    step : float
        Macro step [s]; the first one where ``control`` chooses the others.
    start : float
        Time of the start [s].
    scheme : "jacobi" or "gauss_seidel"
    hold : "midpoint", "constant", "linear" or "quadratic"
        What an input is during the step, see `snarelab.cosim.hold`.
    iterate : bool or Iteration
        Repeat each step until the outputs at its end are those that were assumed.
    control : StepControl, optional
        Choose the macro step by its error.
    solve_loops : bool
        Solve algebraic loops (True), or refuse them.

    Raises
    ------
    InputError
        Before anything steps: for unknown names, or participants that cannot save and restore where steps are repeated.
    """

    def __init__(
        self,
        system: System,
        step: float = 1e-3,
        *,
        start: float = 0.0,
        scheme: Scheme = "jacobi",
        hold: HoldName = "midpoint",
        iterate: bool | Iteration = False,
        control: StepControl | None = None,
        solve_loops: bool = True,
    ) -> None:
        """Initialise all participants."""
        if scheme not in ("jacobi", "gauss_seidel"):
            raise InputError(f"scheme {scheme!r} is unknown; choose jacobi or gauss_seidel")
        if not (step > 0 and math.isfinite(step)):
            raise InputError(f"macro step {step} s is not positive; give for example 1e-3")
        self.system, self.size, self._control = system, float(step), control
        self._hold = hold_named(hold)
        self._participants = list(system.participants.values())
        self._fixed = [name for name, p in system.participants.items() if not p.can_vary_step]
        iteration = (iterate if isinstance(iterate, Iteration) else Iteration()) if iterate else None
        self._step = MacroStep(system, self._hold, iteration, control)
        self._bonds = BondEnergy(system)
        for name, participant in system.participants.items():
            participant.initialize(start, system.parameters_of(name))
        self._feed = FeedThrough(system, solve_loops)
        self._sweep = Sweep(system, self._hold, self._feed, sequential=scheme == "gauss_seidel")
        self._eventful = [
            (name, p) for name, p in system.participants.items() if type(p).next_event is not Participant.next_event
        ]
        self._origin, self._count = float(start), 0
        self.time = float(start)
        self.log = self._step.log
        self.steps = 0
        self._step.begin(self._sweep, self._first_outputs())
        self._loop: CompiledLoop | Literal[False] | None = None  # not looked for yet
        self.record = Record(system)
        self.record.add(self.time, self._step.past[0], self._bonds.residual)

    def step(self) -> float:
        """Take one macro step; the time [s] reached.

        Raises StepError. Where steps are repeated (iteration, step control) participants are then back at the last good
        step; otherwise only the recording is.
        """
        self._advance(self.size)
        return self.time

    def set_step(self, size: float) -> None:
        """Take macro steps of another size [s] from now on."""
        if size != self.size:
            self.size, self._origin, self._count = float(size), self.time, 0

    def run(self, until: float, progress: Callable[[float], None] | None = None) -> Run:
        """Step to a time [s], whose last step is cut to end there.

        ``progress`` is called with the time after each step. Raises StepError where a participant fails; `result` then
        gives what there is up to the last good step.
        """
        self.go_to(until, progress)
        return self.result()

    def go_to(self, until: float, progress: Callable[[float], None] | None = None) -> None:
        """As `run`, for many short runs whose recording is wanted once, from `result`."""
        if not self.time <= until < math.inf:
            raise InputError(f"cannot run to {until} s: the time is {self.time:.9g} s already; give a later one")
        steps = (until - self.time) / self.size
        if self._fixed and abs(steps - round(steps)) > 1e-6:
            raise InputError(
                f"{until} s is {steps:.9g} steps away, and {self._fixed[0]} cannot vary its step; give a whole number"
            )
        while (left := until - self.time) > _SAME * self.size:
            if self._take_compiled(int(left / self.size + _SAME)):
                if progress:
                    progress(self.time)
                continue
            for _, participant in self._eventful:
                left = min(left, participant.next_event(self.time) - self.time)
            cut = left < self.size * (1 - _SAME)
            self._advance(left if cut else self.size, usual=self.size if cut else None)
            if progress:
                progress(self.time)

    def result(self) -> Run:
        """The run so far."""
        return Run(
            self.record.dataset(),
            self.steps,
            self.rejected,
            self.evaluations,
            dict(zip(self._bonds.names, map(float, self._bonds.residual), strict=True)),
            dict(zip(self._bonds.names, map(float, self._bonds.exchanged), strict=True)),
            tuple(self.log),
            tuple(self._feed.loops),
        )

    @property
    def rejected(self) -> int:
        """Number of steps that were repeated with a smaller size."""
        return self._step.rejected

    @property
    def evaluations(self) -> int:
        """How often the participants have stepped altogether."""
        return self._step.evaluations

    def value(self, name: str) -> float:
        """An output ``participant.variable`` now [its unit]; InputError with the nearest where there is none."""
        outputs = self.system.layout.outputs
        if name not in outputs:
            raise InputError(f"no output {name!r}; nearest is {nearest(name, outputs)!r}")
        return float(self._step.past[0][outputs.index(name)])

    def close(self) -> None:
        """Close all participants."""
        for participant in self._participants:
            participant.close()

    def __enter__(self) -> Self:
        """The master."""
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Close."""
        self.close()

    def _take_compiled(self, n: int) -> bool:
        """Up to as many equal steps by the compiled loop; False where it cannot take them."""
        points, step = self._hold.degree + 1, self._step
        if step.repeats or self._bonds.names or len(step.past) < points or set(step.sizes) - {self.size}:
            return False
        if self._loop is None:
            self._loop = compiled_loop(self.system, self._sweep, self.size) or False
        if self._loop is False or n < 1:
            return False
        rows = self.record.window(points, min(n, _AT_ONCE))
        done, call, unit, status = self._loop(rows, self._origin, self._count)
        if done:
            self.steps += done
            step.evaluations += done
            self._count += done
            self.record.count += done
            step.past = [rows[done + k, 1:].copy() for k in reversed(range(points))]
            self.time = float(rows[points - 1 + done, 0])
        if call:
            self._explain(call, unit, status, rows[points + done, 1:])
        return True

    def _explain(self, call: str, unit: int, status: int, outputs: np.ndarray) -> None:
        """Raise what the compiled loop met, in the words of the others."""
        try:
            if call == "finite":
                self._sweep.check(self.time + self.size, outputs)
            calls = self._participants[unit].compiled_calls()
            calls.failed(call, status, f" in the step from {self.time:.9g} s")
        except StepError as failure:
            named = failure if call == "finite" else self._sweep.failure(unit, self.time, failure)
            raise StepError(f"{named}; last good step ended at {self.time:.9g} s") from None

    def _advance(self, size: float, usual: float | None = None) -> None:
        """One accepted macro step [s] of at most this size, cut from the usual one where that is given."""
        taken = self._step.take(self.time, size, usual)
        if taken.wanted is not None:
            self.size = taken.wanted
        outputs, size = taken.outputs, taken.size
        if self._bonds.names:
            self._bonds.add(self._step.past[0], outputs, self._sweep.mean_inputs, size)
        if self._control is None and size == self.size:
            self._count += 1
            self.time = self._origin + self._count * size
        else:
            self.time += size
            self._origin, self._count = self.time, 0
        self._step.remember(taken)
        self.steps += 1
        for name, participant in self._eventful:
            self.log += [Event(self.time, size, f"{name}: {text}") for text in participant.events()]
        self.record.add(self.time, outputs, self._bonds.residual)

    def _first_outputs(self) -> np.ndarray:
        outputs = np.zeros(len(self.system.layout.outputs))
        for i, where in enumerate(self.system.layout.output_slices):
            if i not in self._feed.wholly:
                outputs[where] = self._participants[i].outputs()
        self._feed.settle(self.time, outputs)
        self._sweep.check(self.time, outputs)
        return outputs
