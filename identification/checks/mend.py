"""Lines for the model file that mend what a check found."""

from dataclasses import replace

import numpy as np
import xarray as xr

from ...models.model import Model
from ...models.model_write import toml_text
from ...recordings.columns import split_header
from ...recordings.mixes import signal_fields
from ...recordings.signals import Signal
from ...recordings.units import convert, parse_unit


class Mends:
    """Writes [signals] entries that read a recording's columns in another way.

    Parameters
    ----------
    model : Model
    dataset : xarray.Dataset
        One of its recordings, which says what each signal was read from.
    """

    def __init__(self, model: Model, dataset: xr.Dataset) -> None:
        """Keep both."""
        self._model, self._dataset = model, dataset

    def scaled(self, name: str, factor: float, unit: str = "") -> str:
        """The signal times a factor; as a ``unit`` where it has none of its own yet, else as gain or weight."""
        signal, header_unit = self._own(name)
        if unit and signal.unit is None and signal.gain is None and header_unit in (None, ""):
            return self._line(name, replace(signal, unit=unit))
        if isinstance(signal.gain, int | float):
            return self._line(name, replace(signal, gain=_round(signal.gain * factor)))
        if signal.gain is None and signal.unit is None and header_unit is None and not signal.columns:
            return self._line(name, replace(signal, gain=_round(factor)))
        weights = {str(c): _round(w * factor) for c, w in self._parts(name, signal).items()}
        return self._line(name, replace(signal, column="", columns=weights, offset=_round(signal.offset * factor)))

    def shifted(self, name: str, offset: float) -> str:
        """The signal plus an offset [rad or m], written in the column's own unit."""
        signal, header_unit = self._own(name)
        unit = signal.unit or header_unit
        if isinstance(signal.gain, int | float):
            offset /= signal.gain
        elif unit:
            one = float(
                convert(np.array([1.0]), parse_unit(unit, name, self._model.path), "rad" if _angle(unit) else "m")[0]
            )
            offset /= one
        return self._line(name, replace(signal, offset=_round(signal.offset + offset)))

    def taken_from(self, name: str, other: str) -> str:
        """The signal read from what another one is read from."""
        signal, _ = self._own(other)
        return self._line(name, signal)

    def _own(self, name: str) -> tuple[Signal, str | None]:
        """The signal as the model file has it, or as its own column; and the unit of its header."""
        given = self._model.signals.get(name)
        header = str(self._dataset[name].attrs.get("column", name)) if name in self._dataset else name
        if name == "time":
            header = str(self._dataset["time"].attrs.get("column", name))
        bare, unit = split_header(header)
        return given or Signal(bare), unit

    def _parts(self, name: str, signal: Signal) -> dict[str | int, float]:
        return dict(signal.parts)

    @staticmethod
    def _line(name: str, signal: Signal) -> str:
        return f"{toml_text(name)} = {toml_text(signal_fields(signal))}"


def _round(value: float) -> float:
    """Six digits: more are not known, and none is written that would not be read back."""
    return float(f"{value:.6g}")


def _angle(unit: str) -> bool:
    return unit.strip().lower() in ("deg", "degree", "degrees", "rad", "mrad", "turn", "rev", "grad", "°")
