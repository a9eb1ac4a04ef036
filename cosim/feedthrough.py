"""Direct feedthrough: the order in which participants are evaluated, and algebraic loops.

After a step, an output with direct feed-through is only right when the inputs that it depends on are. The order
follows from the graph of outputs; outputs that depend on each other in a circle form an algebraic loop, which is
solved by quasi-Newton iteration, or refused by name.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from graphlib import TopologicalSorter

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ..errors import InputError
from .iteration import ConvergenceError, Iteration, QuasiNewton
from .participant import Participant, StepError
from .system import System

_RUNAWAY = 1e-3 / np.finfo(float).eps  # times the magnitude: rounding is a thousandth of it, and hides any residual
_MOVES = (1e-3, 1.0)  # tried on an input of unknown effect, times its magnitude or 1


@dataclass(frozen=True)
class _Loop:
    """Outputs of an algebraic loop, and the participants that give them."""

    outputs: tuple[int, ...]
    participants: tuple[int, ...]


class FeedThrough:
    """The order in which outputs are brought up to date after a step.

    Parameters
    ----------
    system : System
        Initialised; inputs of unknown effect are moved and put back.
    solve_loops : bool
        Solve algebraic loops; else refuse them.

    Raises
    ------
    InputError
        For an algebraic loop, by the names of its outputs, unless they are to be solved.
    """

    def __init__(self, system: System, solve_loops: bool = True) -> None:
        """Find the order."""
        self._layout = system.layout
        self._participants: Sequence[Participant] = list(system.participants.values())
        self.names = tuple(system.participants)
        layout = self._layout
        self._reading = [
            (layout.source[at], layout.factor[at], layout.offset[at], shown)
            for at, shown in zip(layout.input_slices, layout.output_slices, strict=True)
        ]
        edges = self._edges(system)
        self.order = self._sort(edges)
        self.loops = [
            " -> ".join(self._layout.outputs[o] for o in loop.outputs) for loop in self.order if isinstance(loop, _Loop)
        ]
        if self.loops and not solve_loops:
            raise InputError(
                f"{system.name}: algebraic loop {self.loops[0]}; put a state between them, or have loops solved"
            )
        settled = {o for loop in self.order if isinstance(loop, _Loop) for o in loop.outputs}
        #: Participants all of whose outputs follow inputs: nothing can be asked of them before these are known.
        self.wholly = {
            i
            for i, at in enumerate(self._layout.output_slices)
            if at.stop > at.start and all(edges.get(o) and o not in settled for o in range(at.start, at.stop))
        }
        self._solver = QuasiNewton(Iteration(tolerance=1e-12, limit=50, kept=8))

    def settle(self, time: float, outputs: np.ndarray) -> None:
        """Bring outputs (n_outputs,) up to date in place; raises StepError where a loop does not converge."""
        for visit in self.order:
            if isinstance(visit, _Loop):
                self._solve(visit, time, outputs)
            else:
                self.ask(visit, outputs)

    def ask(self, participant: int, outputs: np.ndarray) -> None:
        """Set one participant's inputs from the present outputs, and take its outputs."""
        source, factor, offset, shown = self._reading[participant]
        try:
            self._participants[participant].set_inputs(factor * outputs[source] + offset)
            outputs[shown] = self._participants[participant].outputs()
        except Exception as error:  # another's code may raise anything; it is named and passed on
            raise self.failure(participant, error) from error

    def failure(self, participant: int, error: Exception, when: str = "") -> StepError:
        """A participant's error under its name in the system, with the time where it says none; whatever it was."""
        name = self.names[participant]
        text = str(error) if isinstance(error, StepError) else f"{type(error).__name__}: {error}"
        for known in (name, self._participants[participant].name):
            text = text.removeprefix(f"{known}: ")
        return StepError(f"{name}: {text}" + ("" if when in text else f", in {when}"))

    def _solve(self, loop: _Loop, time: float, outputs: np.ndarray) -> None:
        members = list(loop.outputs)

        def ask_all(assumed: np.ndarray) -> np.ndarray:
            outputs[members] = assumed
            for participant in loop.participants:
                self.ask(participant, outputs)
            return outputs[members]

        guess = outputs[members]
        scale = np.maximum(np.abs(guess), 1.0)
        try:
            found = self._solver.solve(ask_all, guess, scale)[0]
            if (largest := float(np.max(np.abs(found) / scale))) > _RUNAWAY:
                self._solver.forget()
                raise ConvergenceError(f"values ran away to {largest:.1e} of their magnitude, where rounding hides all")
            outputs[members] = found
        except ConvergenceError as error:
            names = " -> ".join(self._layout.outputs[o] for o in members)
            raise StepError(
                f"algebraic loop {names} at {time:.9g} s: {error}; put a state between them, or a smaller gain"
            ) from None

    def _edges(self, system: System) -> dict[int, set[int]]:
        """For each output the outputs that it depends on at once."""
        layout, edges = self._layout, defaultdict(set)
        positions = {name: i for i, name in enumerate(layout.inputs)}
        for index, (key, participant) in enumerate(system.participants.items()):
            shown = [v for v in participant.variables if v.causality == "output"]
            moved = self._moved(index) if any(v.depends is None for v in shown) else None
            for i, variable in enumerate(shown):
                output = layout.output_slices[index].start + i
                if variable.depends is None:
                    first = layout.input_slices[index].start
                    followed = [first + int(j) for j in np.flatnonzero(moved[i])] if moved is not None else []
                else:
                    followed = [positions[f"{key}.{name}"] for name in variable.depends]
                edges[output] = {int(layout.source[j]) for j in followed if layout.factor[j] != 0}
        return edges

    def _moved(self, index: int) -> np.ndarray:
        """Which outputs answer to which inputs now, (n_outputs, n_inputs): each input is moved and put back."""
        participant = self._participants[index]
        variables = [v for v in participant.variables if v.causality == "input"]
        start = np.array([v.start for v in variables])
        state = participant.save() if participant.can_restore else None
        participant.set_inputs(start)
        still = participant.outputs().copy()
        answers = np.zeros((len(still), len(start)), dtype=bool)
        for j in range(len(start)):
            for move in _MOVES:
                inputs = start.copy()
                inputs[j] += move * (abs(start[j]) or 1.0)
                participant.set_inputs(np.clip(inputs, [v.minimum for v in variables], [v.maximum for v in variables]))
                answers[:, j] |= participant.outputs() != still
        participant.set_inputs(start)
        if state is not None:
            participant.restore(state)
        return answers

    def _sort(self, edges: dict[int, set[int]]) -> list[int | _Loop]:
        """Participants to be asked, once for each level of feed-through, and the loops between them."""
        n = len(self._layout.outputs)
        pairs = [(o, s) for o, sources in edges.items() for s in sources]
        if not pairs:
            return []
        graph = csr_array((np.ones(len(pairs)), tuple(np.array(pairs).T)), shape=(n, n))
        _, group = connected_components(graph, connection="strong")
        members: dict[int, list[int]] = defaultdict(list)
        for output, g in enumerate(group):
            members[int(g)].append(output)
        after = {g: {int(group[s]) for o in m for s in edges.get(o, ())} - {g} for g, m in members.items()}
        owner = np.repeat(np.arange(len(self._participants)), [s.stop - s.start for s in self._layout.output_slices])
        level: dict[int, int] = {}
        visits: dict[int, list[int | _Loop]] = defaultdict(list)
        for g in TopologicalSorter(after).static_order():
            follows = any(edges.get(o) for o in members[g])
            level[g] = max((level[b] for b in after[g]), default=0) + 1 if follows else 0
            if not follows:
                continue
            if len(members[g]) > 1 or members[g][0] in edges[members[g][0]]:
                owners = tuple(dict.fromkeys(int(owner[o]) for o in members[g]))
                visits[level[g]].append(_Loop(tuple(members[g]), owners))
            elif (who := int(owner[members[g][0]])) not in visits[level[g]]:
                visits[level[g]].append(who)
        return [visit for at in sorted(visits) for visit in visits[at]]
