"""One macro step: explicit, iterated, or repeated with smaller sizes until its error is accepted.

Explicit, it is one sweep over all participants. Iterated, participants go back to the start of the step until the
outputs that were assumed at its end are those that come out. Under step control they go back where the step was too
large.

At the start one value is known, and no parabola. An input that is held there is off by its slope times the step, which
leaves an error of order H² in all that follows. Where the hold has more to lose, and all participants can restore, the
first step is therefore iterated, on the line between its ends.
"""

import math
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from .hold import Hold, combine, end_weights
from .iteration import ConvergenceError, Iteration, QuasiNewton
from .participant import StepError
from .record import Event
from .step_control import StepControl
from .sweep import Sweep
from .system import System


class AcceptedStep(NamedTuple):
    """An accepted step.

    Parameters
    ----------
    outputs : array (n_outputs,)
        At its end.
    size : float
        As it was taken [s].
    wanted : float or None
        Size of the next step [s]; None where no control chooses.
    """

    outputs: np.ndarray
    size: float
    wanted: float | None


class MacroStep:
    """Takes macro steps, and keeps the last values that the hold reads.

    Parameters
    ----------
    system : System
        Participants are not asked for anything yet.
    hold : Hold
    iteration : Iteration or None
    control : StepControl or None

    Raises
    ------
    InputError
        For participants that cannot save and restore, or vary their step, where that is needed; for unknown names.
    """

    def __init__(
        self, system: System, hold: Hold, iteration: Iteration | None = None, control: StepControl | None = None
    ) -> None:
        """Check what can be checked before anything is initialised."""
        self._system, self._hold, self._control = system, hold, control
        self._participants = list(system.participants.values())
        self.repeats = iteration is not None or control is not None
        if self.repeats:
            self._check_rollback("iterate" if iteration else "control")
        fixed = [name for name, p in system.participants.items() if not p.can_vary_step]
        if fixed and control is not None:
            raise InputError(f"{system.name}: control varies the step, and {fixed[0]} cannot; leave control out")
        self._solver = QuasiNewton(iteration) if iteration else None
        layout = system.layout
        self._magnitudes = control.given_magnitudes(layout.outputs) if control else np.zeros(0)
        sudden = [layout.variables[name].discrete for name in layout.outputs]
        self._coupled = np.array([k for k in np.unique(layout.source[layout.factor != 0]) if not sudden[k]], np.intp)
        self.log: list[Event] = []
        self.rejected = self.evaluations = 0

    def begin(self, sweep: Sweep, outputs: np.ndarray) -> None:
        """All participants are initialised; ``outputs`` (n_outputs,) are their first."""
        self._sweep = sweep
        self.past: list[np.ndarray] = [outputs]  # newest first, as many as the hold reads
        self.sizes: list[float] = []  # of the steps between them
        self._largest = np.abs(outputs)

    def take(self, time: float, size: float, usual: float | None = None) -> AcceptedStep:
        """One accepted macro step from a time [s], of at most this size [s].

        ``usual`` is the size [s] that this one was cut from, if it was: the next step is at least that.
        Raises StepError. Where steps are repeated participants are then back at the start.
        """
        starter = self._starter()
        states = [p.save() for p in self._participants] if self.repeats or starter else []
        while True:
            try:
                outputs = self._trial(time, size, states, starter)
                if self._control is None:
                    return AcceptedStep(outputs, size, None)
                error = self._error(outputs, size)
            except StepError as failure:
                if self._control is None or size <= self._control.smallest:
                    if states:
                        with suppress(StepError):  # what failed may be past putting back; its own fault is told
                            self._restore(states)
                    raise StepError(f"{failure}; last good step ended at {time:.9g} s") from failure
                error, outputs = math.inf, None
                reason = str(failure)
            else:
                reason = f"inputs off by {error:.2g} times the tolerance"
            degree = min(self._hold.degree, len(self.past) - 1)
            wanted = self._control.next_size(size, error, degree, rejected=error > 1)
            if outputs is not None and (error <= 1 or size <= self._control.smallest):
                if error > 1:
                    self.log.append(Event(time, size, f"accepted at the smallest step: {reason}"))
                return AcceptedStep(outputs, size, wanted if usual is None else max(wanted, usual))
            self.rejected += 1
            self.log.append(Event(time, size, f"rejected: {reason}; repeated with {wanted:.3g} s"))
            self._restore(states)
            size, usual = wanted, None

    def remember(self, taken: AcceptedStep) -> None:
        """Keep this step as the last one."""
        self.past.insert(0, taken.outputs)
        self.sizes.insert(0, taken.size)
        del self.past[self._hold.degree + 1 :], self.sizes[self._hold.degree :]
        if self.repeats:
            np.maximum(self._largest, np.abs(taken.outputs), out=self._largest)

    def _starter(self) -> QuasiNewton | None:
        """A solver for the first step, where a held input would cost the hold its order."""
        if self.repeats or self.sizes or self._hold.degree < 2 or not all(p.can_restore for p in self._participants):
            return None
        return QuasiNewton(Iteration())

    def _trial(self, time: float, size: float, states: list[object], starter: QuasiNewton | None) -> np.ndarray:
        """Outputs (n_outputs,) at the end of a step, by one sweep or by iteration."""
        if starter is not None:
            try:
                return self._iterated(starter, time, size, states)
            except ConvergenceError as error:
                self.log.append(Event(time, size, f"the start was not iterated ({error}): inputs were held"))
                self._restore(states)
        if self._solver is None:
            self.evaluations += 1
            return self._sweep(time, size, self.past, self.sizes)
        try:
            return self._iterated(self._solver, time, size, states)
        except ConvergenceError as error:
            raise StepError(
                f"{self._system.name}: the iteration of the step at {time:.9g} s did not converge ({error}); "
                "take smaller steps"
            ) from None

    def _iterated(self, solver: QuasiNewton, time: float, size: float, states: list[object]) -> np.ndarray:
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
            reached = self._sweep(time, size, self.past, self.sizes, ahead)
            return reached[self._coupled]

        scale = np.maximum(self._largest, np.abs(guess))[self._coupled]
        scale[scale == 0] = 1.0
        solver.solve(sweep_from, guess[self._coupled], scale)
        return reached

    def _predicted(self, size: float) -> np.ndarray:
        """Where the hold's polynomial puts the outputs at the end of a step."""
        return combine(end_weights(self._sweep.nodes(size, self.sizes)), self.past)

    def _error(self, outputs: np.ndarray, size: float) -> float:
        """Distance of the coupled outputs from what was predicted, in tolerances."""
        assert self._control is not None
        chosen = self._coupled
        off = np.abs(outputs - self._predicted(size))[chosen]
        magnitude = np.where(self._magnitudes > 0, self._magnitudes, np.maximum(self._largest, np.abs(outputs)))[chosen]
        magnitude[magnitude == 0] = 1.0
        return float(np.max(off / magnitude, initial=0.0)) / self._control.tolerance

    def _restore(self, states: list[object]) -> None:
        for participant, state in zip(self._participants, states, strict=True):
            participant.restore(state)

    def _check_rollback(self, wish: str) -> None:
        stuck = [name for name, p in self._system.participants.items() if not p.can_restore]
        if stuck:
            raise InputError(
                f"{self._system.name}: {wish} repeats steps, and {', '.join(stuck)} cannot save and restore; "
                f"leave {wish} out, or use a participant that can"
            )
