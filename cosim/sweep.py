"""One pass over all participants: each gets its inputs for the macro step and takes the step."""

from dataclasses import dataclass

import numpy as np

from .feedthrough import FeedThrough
from .hold import HALVES, Hold, combine, end_weights, weights
from .participant import Participant, StepError
from .system import System


@dataclass(frozen=True)
class SweepPlan:
    """What a compiled loop of equal steps needs beyond the layout.

    Parameters
    ----------
    visits : tuple of int
        Participants to be brought up to date after a step, in order.
    follow : tuple of int
        Participants with direct feed-through.
    halves : tuple of int
        Participants that take other inputs for the second half of a step.
    before : tuple of tuples of float
        The hold's weights where the newest value is that of the step's start: for what is held over the step, and, if
        anyone takes halves, over each of them.
    end : tuple of float
        The weights of the value at the step's end, where the newest one is that of its start.
    after : tuple of tuples of float
        As `before`, where the newest value is that of the step's end.
    sequential : bool
    """

    visits: tuple[int, ...]
    follow: tuple[int, ...]
    halves: tuple[int, ...]
    before: tuple[tuple[float, ...], ...]
    end: tuple[float, ...]
    after: tuple[tuple[float, ...], ...]
    sequential: bool


class Sweep:
    """A macro step, side by side or one after another.

    Parameters
    ----------
    system : System
    hold : Hold
    feed : FeedThrough
    sequential : bool
        Gauss-Seidel; else Jacobi.
    """

    def __init__(self, system: System, hold: Hold, feed: FeedThrough, sequential: bool) -> None:
        """Lay out."""
        self._system, self._layout, self._hold, self._feed = system, system.layout, hold, feed
        self._participants = list(system.participants.values())
        self._sequential = sequential
        self._orders = tuple(_order(p, hold) for p in self._participants)
        self._follow = [
            i
            for i, p in enumerate(self._participants)
            if any(v.depends != () for v in p.variables if v.causality == "output")
        ]
        # What runs beside the rest starts before what holds everything up.
        self._starts = sorted(
            range(len(self._participants)), key=lambda i: type(self._participants[i]).begin is Participant.begin
        )
        layout = self._layout
        sudden = np.array([layout.variables[name].discrete for name in layout.outputs], dtype=bool)
        jumps = sudden[layout.source] & (layout.factor != 0)
        self._jumps = [np.flatnonzero(jumps[at]) for at in layout.input_slices]
        self.mean_inputs = np.zeros(len(layout.inputs))
        self._reading = [
            (
                layout.source[at],
                layout.factor[at],
                layout.offset[at],
                self.mean_inputs[at],
                np.zeros(at.stop - at.start),
            )
            for at in layout.input_slices
        ]

    def nodes(self, size: float, sizes: list[float], ahead: bool = False) -> tuple[float, ...]:
        """Times of the known values in steps from the start of this one, newest first."""
        times = [1.0, 0.0] if ahead else [0.0]
        for past in sizes:
            times.append(times[-1] - past / size)
        return tuple(times[: self._hold.degree + 1])

    def __call__(
        self, time: float, size: float, past: list[np.ndarray], sizes: list[float], ahead: np.ndarray | None = None
    ) -> np.ndarray:
        """Step everyone; outputs (n_outputs,) at the end.

        Parameters
        ----------
        time, size : float
            Start and length of the macro step [s].
        past : list of arrays (n_outputs,)
            Outputs at the start and before, newest first.
        sizes : list of float
            Steps between them [s].
        ahead : array (n_outputs,), optional
            Outputs assumed at the end.

        Raises
        ------
        StepError
            From the participant that failed, or for an output that is not a finite number.
        """
        if self._sequential:
            outputs = self._one_by_one(time, size, past, sizes, ahead)
        else:
            outputs = self._side_by_side(time, size, past, sizes, ahead)
        self._feed.settle(time + size, outputs)
        self.check(time + size, outputs)
        return outputs

    def plan(self, size: float) -> SweepPlan | None:
        """The data of a compiled loop; None where such a loop would give other results."""
        if any(order > 0 for order in self._orders) or self._feed.loops or any(len(jumps) for jumps in self._jumps):
            return None
        back, ahead = (tuple(start - k for k in range(self._hold.degree + 1)) for start in (0.0, 1.0))
        halves = tuple(i for i, order in enumerate(self._orders) if order == HALVES)
        before, after = (
            tuple(row for order in ((0, HALVES) if halves else (0,)) for row in weights(self._hold, nodes, size, order))
            for nodes in (back, ahead)
        )
        visits = tuple(visit for visit in self._feed.order if isinstance(visit, int))
        return SweepPlan(visits, tuple(self._follow), halves, before, end_weights(back), after, self._sequential)

    def failure(self, i: int, time: float, error: Exception) -> StepError:
        """The failure of participant ``i`` in the step from a time [s]."""
        return self._feed.failure(i, error, f"the step from {time:.9g} s")

    def check(self, time: float, outputs: np.ndarray) -> None:
        """Refuse outputs that are not finite, by name."""
        if not np.isfinite(np.add.reduce(outputs)) and not np.isfinite(outputs).all():
            bad = int(np.flatnonzero(~np.isfinite(outputs))[0])
            raise StepError(f"{self._layout.outputs[bad]} is {outputs[bad]} at {time:.9g} s; take smaller steps")

    def _side_by_side(
        self, time: float, size: float, past: list[np.ndarray], sizes: list[float], ahead: np.ndarray | None
    ) -> np.ndarray:
        values = past if ahead is None else [ahead, *past]
        nodes = self.nodes(size, sizes, ahead is not None)
        held = {
            order: [combine(row, values) for row in weights(self._hold, nodes, size, order)]
            for order in set(self._orders)
        }
        failures: list[tuple[Exception, Exception]] = []
        begun = []
        for i in self._starts:
            try:
                self._give(i, held[self._orders[i]], size, past[0])
                self._participants[i].begin(time, size)
                begun.append(i)
            except Exception as error:  # the others must come to rest before anything else is done
                failures.append((self.failure(i, time, error), error))
                break
        for i in begun:
            try:
                self._participants[i].finish()
            except Exception as error:  # every one must be waited for, whatever the others raise
                failures.append((self.failure(i, time, error), error))
        if failures:
            failure, cause = failures[0]
            raise failure from cause
        outputs = np.empty(len(self._layout.outputs))
        for i, participant in enumerate(self._participants):
            try:
                outputs[self._layout.output_slices[i]] = participant.outputs()
            except Exception as error:  # another's code may raise anything; it is named and passed on
                raise self.failure(i, time, error) from error
        return outputs

    def _one_by_one(
        self, time: float, size: float, past: list[np.ndarray], sizes: list[float], ahead: np.ndarray | None
    ) -> np.ndarray:
        before = self.nodes(size, sizes)
        after = self.nodes(size, sizes, ahead=True)
        outputs = combine(end_weights(before), past) if ahead is None else ahead.copy()
        orders = set(self._orders)
        rows_after = {order: weights(self._hold, after, size, order) for order in orders}
        if ahead is None:
            held = {o: [combine(row, past) for row in weights(self._hold, before, size, o)] for o in orders}
        else:
            held = {o: [combine(row, [ahead, *past]) for row in rows_after[o]] for o in orders}
        for i, participant in enumerate(self._participants):
            where = self._layout.output_slices[i]
            try:
                self._give(i, held[self._orders[i]], size, past[0])
                participant.begin(time, size)
                participant.finish()
                if i in self._follow:
                    self._feed.ask(i, outputs)
                else:
                    outputs[where] = participant.outputs()
            except Exception as error:  # another's code may raise anything; it is named and passed on
                raise self.failure(i, time, error) from error
            known = [outputs[where], *(value[where] for value in past)]
            for order in orders:
                rows = rows_after[order]
                for row, array in zip(rows, held[order], strict=False):
                    array[where] = combine(row, known)
                for row in rows[len(held[order]) :]:  # the first steps know a slope only once someone has gone ahead
                    held[order].append(np.zeros(len(outputs)))
                    held[order][-1][where] = combine(row, known)
        return outputs

    def _give(self, i: int, held: list[np.ndarray], size: float, start: np.ndarray) -> None:
        """Set a participant's inputs, and their derivatives where it takes them.

        What comes from a discrete output is what that was at the step's start, ``start`` (n_outputs,).
        """
        source, factor, offset, mean, still = self._reading[i]
        jumps = self._jumps[i]
        participant, order = self._participants[i], self._orders[i]
        values = factor * held[0][source] + offset
        if len(jumps):
            values[jumps] = factor[jumps] * start[source[jumps]] + offset[jumps]
        if order == HALVES:
            second = factor * held[1][source] + offset
            second[jumps] = values[jumps]
            participant.set_input_halves(values, second)
            mean[:] = 0.5 * (values + second)
            return
        participant.set_inputs(values)
        mean[:] = values
        if participant.input_order and not self._hold.middle:
            slopes = [factor * row[source] for row in held[1 : order + 1]]
            for slope in slopes if len(jumps) else ():
                slope[jumps] = 0.0
            first, second = (*slopes, still, still)[:2]
            participant.set_input_derivatives(first, second)
            if slopes:
                mean += first * (size / 2) + second * (size * size / 6)


def _order(participant: Participant, hold: Hold) -> int:
    """How much of a hold's polynomial a participant is given; halves where it takes no slope and the hold has more."""
    if hold.middle:
        return 0
    if not participant.input_order and participant.can_halve and hold.degree > 1:
        return HALVES
    return min(participant.input_order, hold.degree)
