"""Participants and their connections, checked before the first step."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from ..errors import InputError, nearest
from .participant import Participant, Variable
from .units import conversion


@dataclass(frozen=True)
class Connection:
    """An output that an input reads: input = factor·output + offset, both in the input's unit.

    Parameters
    ----------
    source, target : str
        ``participant.variable`` of an output and of an input.
    factor, offset : float
        Applied after the conversion of units; -1 turns an action into its reaction.
    """

    source: str
    target: str
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class PowerBond:
    """Two connections, one each way, whose product is the power that crosses: a force and a speed, for example.

    Parameters
    ----------
    name : str
    effort, flow : str
        Outputs ``participant.variable`` of two participants, each read by the other one.
    """

    name: str
    effort: str
    flow: str


@dataclass(frozen=True)
class Layout:
    """Where everything lies in the system's two vectors: all outputs, all inputs, participant after participant.

    Input i is ``factor[i]·outputs[source[i]] + offset[i]``; an input with a given value has factor 0.
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    output_slices: tuple[slice, ...]
    input_slices: tuple[slice, ...]
    source: np.ndarray
    factor: np.ndarray
    offset: np.ndarray
    variables: Mapping[str, Variable] = field(repr=False)


class System:
    """Participants by name, and the connections between them.

    Parameters
    ----------
    participants : mapping of str to Participant
        Names without dots. Their order is the order in which a sequential master steps them.
    connections : sequence of Connection or pairs of str
        ``("left.force", "right.force")``: from an output to an input.
    parameters : mapping of str to float
        Values of parameters, and of inputs that nothing is connected to, as ``participant.variable`` [its unit].
    bonds : sequence of PowerBond
        The bonds whose energy residual is recorded.
    name : str

    Raises
    ------
    InputError
        With every problem found: unknown names (and the nearest known), inputs unconnected or connected twice, units
        of different dimensions, values out of bounds.
    """

    def __init__(
        self,
        participants: Mapping[str, Participant],
        connections: Sequence[Connection | tuple[str, str]] = (),
        *,
        parameters: Mapping[str, float] | None = None,
        bonds: Sequence[PowerBond] = (),
        name: str = "system",
    ) -> None:
        """Check and lay out; nothing is initialised."""
        self.name = name
        self.participants = dict(participants)
        self.connections = tuple(c if isinstance(c, Connection) else Connection(*c) for c in connections)
        self.bonds = tuple(bonds)
        self.given = {key: float(value) for key, value in (parameters or {}).items()}
        problems = [
            f"participant {key!r} has a dot in its name; leave it out" for key in self.participants if "." in key
        ]
        if len({id(p) for p in self.participants.values()}) < len(self.participants):
            problems.append("one participant stands under two names; build two")
        self._variables = {f"{key}.{v.name}": v for key, p in self.participants.items() for v in p.variables}
        links = self._links(problems)
        self._check_given(links, problems)
        if problems:
            raise InputError(f"{name}: {'; '.join(problems)}")
        self.layout = self._lay_out(links)

    def parameters_of(self, participant: str) -> dict[str, float]:
        """Given parameters of one participant, by its own names."""
        mine = {key.partition(".")[2]: value for key, value in self.given.items() if key.startswith(f"{participant}.")}
        return {key: mine[key] for key in mine if self._variables[f"{participant}.{key}"].causality == "parameter"}

    def names(self, causality: str) -> list[str]:
        """``participant.variable`` of one causality, in order."""
        return [key for key, variable in self._variables.items() if variable.causality == causality]

    def unit(self, name: str) -> str:
        """Unit of a variable."""
        return self._variables[name].unit

    def connection(self, source: str, participant: str) -> Connection | None:
        """The connection that carries an output into a participant."""
        return next(
            (c for c in self.connections if c.source == source and c.target.startswith(f"{participant}.")), None
        )

    def _links(self, problems: list[str]) -> dict[str, tuple[str, float, float]]:
        """Source, factor and offset of each connected input, units converted."""
        links: dict[str, tuple[str, float, float]] = {}
        for c in self.connections:
            wrong = self._unknown(c.source, "output", f"{c.source} -> {c.target}")
            wrong += self._unknown(c.target, "input", f"{c.source} -> {c.target}")
            if wrong:
                problems += wrong
                continue
            if c.target in links:
                problems.append(f"input {c.target} is connected to {links[c.target][0]} and {c.source}; keep one")
            try:
                factor, offset = conversion(self.unit(c.source), self.unit(c.target))
            except InputError as error:
                problems.append(f"{c.source} -> {c.target}: {error}; connect quantities of one kind")
                continue
            links[c.target] = (c.source, c.factor * factor, c.factor * offset + c.offset)
        loose = [name for name in self.names("input") if name not in links and name not in self.given]
        broken = {c.target for c in self.connections}
        problems += [
            f"input {name} is not connected; connect it, or give it a value among the parameters"
            for name in loose
            if name not in broken
        ]
        return links

    def _check_given(self, links: Mapping[str, tuple[str, float, float]], problems: list[str]) -> None:
        for name, value in self.given.items():
            wrong = self._unknown(name, "parameter", "parameters", "input")
            problems += wrong
            if wrong:
                continue
            variable = self._variables[name]
            if name in links:
                problems.append(f"input {name} has a value and is connected to {links[name][0]}; keep one")
            if not variable.minimum <= value <= variable.maximum:
                problems.append(f"{name} = {value:g} is outside {variable.minimum:g} to {variable.maximum:g}")

    def _unknown(self, name: str, wanted: str, place: str, other: str = "") -> list[str]:
        """What is wrong with a name: no such participant or variable, or one of another causality."""
        participant = name.partition(".")[0]
        variable = self._variables.get(name)
        if variable is not None and variable.causality in (wanted, other):
            return []
        if participant not in self.participants:
            known = nearest(participant, self.participants)
            return [f"{place}: there is no participant {participant!r}; nearest is {known!r}"]
        text = self.participants[participant].unread.get(name.partition(".")[2])
        if text is not None:
            return [f"{place}: {name!r} holds {text}, not a number; nothing can be connected to it, leave it out"]
        fitting = [n for c in (wanted, other) if c for n in self.names(c) if n.startswith(f"{participant}.")]
        reason = f"is an {variable.causality}, not an {wanted}" if variable else f"is no variable of {participant}"
        hint = f"nearest {wanted} is {nearest(name, fitting)!r}" if fitting else f"{participant} has no {wanted}"
        return [f"{place}: {name!r} {reason.replace('an parameter', 'a parameter')}; {hint}"]

    def _lay_out(self, links: Mapping[str, tuple[str, float, float]]) -> Layout:
        outputs, inputs = self.names("output"), self.names("input")
        where = {name: index for index, name in enumerate(outputs)}
        unconnected = (outputs[0] if outputs else "", 0.0)
        rows = [links.get(name) or (*unconnected, self.given[name]) for name in inputs]
        return Layout(
            tuple(outputs),
            tuple(inputs),
            _slices(len(p.names("output")) for p in self.participants.values()),
            _slices(len(p.names("input")) for p in self.participants.values()),
            np.array([where.get(source, 0) for source, _, _ in rows], dtype=np.intp),
            np.array([factor for _, factor, _ in rows]),
            np.array([offset for _, _, offset in rows]),
            self._variables,
        )


def _slices(counts: Iterable[int]) -> tuple[slice, ...]:
    """Consecutive slices of these lengths."""
    ends = np.cumsum([0, *counts])
    return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
