"""The co-simulation master: who steps when, on which inputs, and what is done when a step is not good enough.

``jacobi`` steps all participants side by side on what was known at the start of the macro step. ``gauss_seidel`` steps
them one after another, each on what the earlier ones have just found. Either is explicit, or is iterated: participants
go back to the start of the step until the outputs that were assumed at its end are those that come out.

At the start one value is known, and no parabola. An input that is held there is off by its slope times the step, which
leaves an error of order H² in all that follows. Where the hold has more to lose, and all participants can restore, the
first step is therefore iterated, on the line between its ends.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Literal, Self

import numpy as np

from ..errors import InputError, nearest
from .compiled_loop import CompiledLoop, compiled_loop
from .energy import BondEnergy
from .feedthrough import FeedThrough
from .hold import combine, end_weights, hold_named
from .iteration import Iteration, NotConverged, QuasiNewton
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
        Repeat each step until the outputs assumed at its end come out.
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
        iteration = (iterate if isinstance(iterate, Iteration) else Iteration()) if iterate else None
        self._repeats = iteration is not None or control is not None
        if self._repeats:
            self._check_rollback("iterate" if iterate else "control")
        self._fixed = [name for name, p in system.participants.items() if not p.can_vary_step]
        if self._fixed and control is not None:
            raise InputError(f"{system.name}: control varies the step, and {self._fixed[0]} cannot; leave control out")
        self._solver = QuasiNewton(iteration) if iteration else None
        self._bonds = BondEnergy(system)
        self._magnitudes = control.given_magnitudes(system.layout.outputs) if control else np.zeros(0)
        for name, participant in system.participants.items():
            participant.initialize(start, system.parameters_of(name))
        self._feed = FeedThrough(system, solve_loops)
        self._sweep = Sweep(system, self._hold, self._feed, sequential=scheme == "gauss_seidel")
        layout = system.layout
        sudden = [layout.variables[name].discrete for name in layout.outputs]
        self._coupled = np.array([k for k in np.unique(layout.source[layout.factor != 0]) if not sudden[k]], np.intp)
        self._eventful = [
            (name, p) for name, p in system.participants.items() if type(p).next_event is not Participant.next_event
        ]
        self._origin, self._count = float(start), 0
        self.time = float(start)
        self.log: list[Event] = []
        self.steps = self.rejected = self.evaluations = 0
        self._past: list[np.ndarray] = [self._first_outputs()]  # newest first, as many as the hold reads
        self._sizes: list[float] = []  # of the steps between them
        self._largest = np.abs(self._past[0])
        self._loop: CompiledLoop | Literal[False] | None = None  # not looked for yet
        self.record = Record(system)
        self.record.add(self.time, self._past[0], self._bonds.residual)

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
            self._advance(left if cut else self.size, keep_size=cut)
            if progress:
                progress(self.time)

    def result(self) -> Run:
        """What there is so far."""
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

    def value(self, name: str) -> float:
        """An output ``participant.variable`` now [its unit]; InputError with the nearest where there is none."""
        outputs = self.system.layout.outputs
        if name not in outputs:
            raise InputError(f"no output {name!r}; nearest is {nearest(name, outputs)!r}")
        return float(self._past[0][outputs.index(name)])

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

    def _advance(self, size: float, keep_size: bool = False) -> None:
        """One accepted macro step of at most this size."""
        starter = self._starter()
        states = [p.save() for p in self._participants] if self._repeats or starter else []
        while True:
            try:
                outputs = self._trial(size, states, starter)
                error = self._error(outputs, size) if self._control else 0.0
            except StepError as failure:
                if self._control is None or size <= self._control.smallest:
                    if states:
                        with suppress(StepError):  # what failed may be past putting back; its own fault is told
                            self._restore(states)
                    raise StepError(f"{failure}; last good step ended at {self.time:.9g} s") from failure
                error, outputs = math.inf, None
                reason = str(failure)
            else:
                reason = f"inputs off by {error:.2g} times the tolerance"
            if self._control is None:
                break
            degree = min(self._hold.degree, len(self._past) - 1)
            wanted = self._control.next_size(size, error, degree, rejected=error > 1)
            if error <= 1 or size <= self._control.smallest:
                if error > 1:
                    self.log.append(Event(self.time, size, f"accepted at the smallest step: {reason}"))
                self.size = max(wanted, self.size) if keep_size else wanted
                break
            self.rejected += 1
            self.log.append(Event(self.time, size, f"rejected: {reason}; repeated with {wanted:.3g} s"))
            self._restore(states)
            size, keep_size = wanted, False
        assert outputs is not None
        self._accept(outputs, size)

    def _take_compiled(self, n: int) -> bool:
        """Up to as many equal steps by the compiled loop; False where it cannot take them."""
        points = self._hold.degree + 1
        if self._repeats or self._bonds.names or len(self._past) < points or set(self._sizes) - {self.size}:
            return False
        if self._loop is None:
            self._loop = compiled_loop(self.system, self._sweep, self.size) or False
        if self._loop is False or n < 1:
            return False
        rows = self.record.window(points, min(n, _AT_ONCE))
        done, call, unit, status = self._loop(rows, self._origin, self._count)
        if done:
            self.steps += done
            self.evaluations += done
            self._count += done
            self.record.count += done
            self._past = [rows[done + k, 1:].copy() for k in reversed(range(points))]
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

    def _starter(self) -> QuasiNewton | None:
        """A solver for the first step, where a held input would cost the hold its order."""
        plain = self._solver is None and self._control is None
        if not plain or self.steps or self._hold.degree < 2 or not all(p.can_restore for p in self._participants):
            return None
        return QuasiNewton(Iteration())

    def _trial(self, size: float, states: list[object], starter: QuasiNewton | None) -> np.ndarray:
        """Outputs (n_outputs,) at the end of a step, by one sweep or by iteration."""
        if starter is not None:
            try:
                return self._iterated(starter, size, states)
            except NotConverged as error:
                self.log.append(Event(self.time, size, f"the start was not iterated ({error}): inputs were held"))
                self._restore(states)
        if self._solver is None:
            self.evaluations += 1
            return self._sweep(self.time, size, self._past, self._sizes)
        try:
            return self._iterated(self._solver, size, states)
        except NotConverged as error:
            raise StepError(
                f"{self.system.name}: the iteration of the step at {self.time:.9g} s did not converge ({error}); "
                "take smaller steps"
            ) from None

    def _iterated(self, solver: QuasiNewton, size: float, states: list[object]) -> np.ndarray:
        """Outputs at the end of a step that are those assumed there; raises NotConverged."""
        guess = self._predicted(size)
        fresh, reached = True, guess

        def sweep_from(assumed: np.ndarray) -> np.ndarray:
            nonlocal fresh, reached
            if not fresh:
                self._restore(states)
            fresh = False
            self.evaluations += 1
            ahead = guess.copy()
            ahead[self._coupled] = assumed
            reached = self._sweep(self.time, size, self._past, self._sizes, ahead)
            return reached[self._coupled]

        scale = np.maximum(self._largest, np.abs(guess))[self._coupled]
        scale[scale == 0] = 1.0
        solver.solve(sweep_from, guess[self._coupled], scale)
        return reached

    def _predicted(self, size: float) -> np.ndarray:
        """Where the hold's polynomial puts the outputs at the end of a step."""
        return combine(end_weights(self._sweep.nodes(size, self._sizes)), self._past)

    def _error(self, outputs: np.ndarray, size: float) -> float:
        """Distance of the coupled outputs from what was predicted, in tolerances."""
        assert self._control is not None
        chosen = self._coupled
        off = np.abs(outputs - self._predicted(size))[chosen]
        magnitude = np.where(self._magnitudes > 0, self._magnitudes, np.maximum(self._largest, np.abs(outputs)))[chosen]
        magnitude[magnitude == 0] = 1.0
        return float(np.max(off / magnitude, initial=0.0)) / self._control.tolerance

    def _accept(self, outputs: np.ndarray, size: float) -> None:
        before = self._past[0]
        if self._bonds.names:
            self._bonds.add(before, outputs, self._sweep.mean_inputs, size)
        if self._control is None and size == self.size:
            self._count += 1
            self.time = self._origin + self._count * size
        else:
            self.time += size
            self._origin, self._count = self.time, 0
        self._past.insert(0, outputs)
        self._sizes.insert(0, size)
        del self._past[self._hold.degree + 1 :], self._sizes[self._hold.degree :]
        if self._repeats:
            np.maximum(self._largest, np.abs(outputs), out=self._largest)
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

    def _restore(self, states: list[object]) -> None:
        for participant, state in zip(self._participants, states, strict=True):
            participant.restore(state)

    def _check_rollback(self, wish: str) -> None:
        stuck = [name for name, p in self.system.participants.items() if not p.can_restore]
        if stuck:
            raise InputError(
                f"{self.system.name}: {wish} repeats steps, and {', '.join(stuck)} cannot save and restore; "
                f"leave {wish} out, or use a participant that can"
            )
