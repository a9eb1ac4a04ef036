"""The recording of a co-simulation: outputs at every communication point."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from ..errors import InputError
from ..recordings.signals import default_unit, is_signal
from .system import System
from .units import conversion


@dataclass(frozen=True)
class Event:
    """An event for the log: a step that was rejected, accepted in spite of its error, or started badly."""

    time: float
    size: float
    text: str

    def __str__(self) -> str:
        """One line."""
        return f"{self.time:.9g} s, step {self.size:.3g} s: {self.text}"


@dataclass(frozen=True)
class Run:
    """A finished run.

    Parameters
    ----------
    recording : xarray.Dataset
        Every output over ``time`` (see `Record.dataset`).
    steps, rejected, evaluations : int
        Macro steps taken; steps that were repeated smaller; how often the participants stepped altogether.
    residual, exchanged : dict of str to float
        Of each power bond: energy that the coupling made, and the sum of what crossed either way [J].
    log : tuple of Event
    loops : tuple of str
        Algebraic loops that were solved.
    """

    recording: xr.Dataset
    steps: int
    rejected: int
    evaluations: int
    residual: dict[str, float]
    exchanged: dict[str, float]
    log: tuple[Event, ...]
    loops: tuple[str, ...]


class Record:
    """The growing rows of time and all outputs.

    Parameters
    ----------
    system : System
    """

    def __init__(self, system: System) -> None:
        """Start empty."""
        self._columns = _columns(system)
        self._rows = np.empty((1024, 1 + len(system.layout.outputs) + len(system.bonds)))
        self._bonds = [bond.name for bond in system.bonds]
        self.count = 0

    def add(self, time: float, outputs: np.ndarray, residual: np.ndarray) -> None:
        """Append one communication point."""
        row = self.window(0, 1)[0]
        row[0] = time
        row[1 : 1 + len(outputs)] = outputs
        if len(residual):
            row[1 + len(outputs) :] = residual
        self.count += 1

    def window(self, back: int, n: int) -> np.ndarray:
        """The last ``back`` rows and the next ``n`` free ones, (back + n, 1 + n_outputs + n_bonds), to be filled.

        They count once `count` is raised.
        """
        if self.count + n > len(self._rows):
            larger = np.empty((max(2 * len(self._rows), self.count + n), self._rows.shape[1]))
            larger[: self.count] = self._rows[: self.count]
            self._rows = larger
        return self._rows[self.count - back : self.count + n]

    @property
    def headers(self) -> list[str]:
        """Names of the columns of `rows` and `dataset`, time first.

        A column is called ``participant.variable [unit]``, or by the variable alone where that is a name that
        recordings have (``q.joint1``, in its default unit) and only one participant shows it; then
        ``residual.<bond> [J]``, what the coupling has made or lost of energy.
        """
        return ["time", *(name for name, _, _ in self._columns), *(f"residual.{name} [J]" for name in self._bonds)]

    def rows(self, first: int = 0) -> np.ndarray:
        """Rows from one on, (n_rows, n_headers), in the headers' units."""
        return np.column_stack(self._in_units(first))

    def _in_units(self, first: int) -> list[np.ndarray]:
        """Columns from a row on, in the headers' order and units."""
        rows = self._rows[first : self.count]
        shown = [factor * rows[:, i] + offset for i, (_, factor, offset) in enumerate(self._columns, 1)]
        return [rows[:, 0].copy(), *shown, *(rows[:, i].copy() for i in range(1 + len(shown), rows.shape[1]))]

    def dataset(self) -> xr.Dataset:
        """Everything so far, in columns called as in `headers`."""
        time, *columns = self._in_units(0)
        named = {name: ("time", column) for name, column in zip(self.headers[1:], columns, strict=True)}
        return xr.Dataset(named, coords={"time": time})


def _columns(system: System) -> list[tuple[str, float, float]]:
    """Header of each output, and what turns its value into the header's unit."""
    shown = Counter(name.partition(".")[2] for name in system.layout.outputs)
    return [_column(name, system.layout.variables[name].unit, shown) for name in system.layout.outputs]


def _column(name: str, unit: str, shown: Mapping[str, int]) -> tuple[str, float, float]:
    signal = name.partition(".")[2]
    if is_signal(signal) and shown[signal] == 1:
        for kind in ("revolute", "prismatic"):
            try:
                return (signal, *conversion(unit, default_unit(signal, kind)))
            except InputError:
                continue
    return (f"{name} [{unit}]" if unit and unit != "1" else name), 1.0, 0.0
