"""The end effector's control program as a participant: a table of states, evaluated once a period."""

from collections.abc import Mapping
from math import degrees, pi
from typing import Any

import numpy as np

from ..participant import Participant, Variable
from ..state_table import StateTable, read_table

_EARLY = 1e-9
_INPUTS = {
    "angle.ring": ("rad", "ring", degrees(1.0)),
    "torque.ring": ("N*m", "ring_torque", 1.0),
    "travel": ("m", "travel", 1e3),
    "rate": ("m/s", "rate", 1e3),
    "gap": ("m", "gap", 1e3),
    "force.motor": ("N", "force", 1.0),
    "force.wrist.x": ("N", "", 1.0),
    "force.wrist.y": ("N", "", 1.0),
    "force.wrist.z": ("N", "", 1.0),
    "switches": ("1", "switches", 1.0),
    "closed": ("1", "closed", 1.0),
    "enclosed": ("1", "enclosed", 1.0),
    "touching": ("1", "touching", 1.0),
    "cables_touching": ("1", "touching", 1.0),
}
"""Input: its unit, the table's sensor, and the sensor's unit in it."""
_OUTPUTS = {
    "rate.ring": ("rad/s", "ring's rate, positive as it closes"),
    "speed": ("m/s", "the carriage's speed, positive as it retracts"),
    "motor": ("1", "the carriage's motor"),
    "brake": ("1", "the carriage's brake"),
    "latch": ("1", "the latches"),
    "servo": ("1", "the joints' servo"),
    "state": ("1", "number of the state, from 0 in the table's order"),
}


class ControlProgram(Participant):
    """A running `StateTable`: sensors in, commands and the number of its state out; all outputs are discrete.

    Transitions are events: no macro step goes past a period's end, and each stands in the master's log.

    Parameters
    ----------
    table : StateTable, optional
        The built-in one where none is given.
    name : str
    """

    can_restore = True

    def __init__(self, table: StateTable | None = None, name: str = "program") -> None:
        """Describe the variables."""
        self.name, self.table = name, table or read_table()
        self.variables = (
            *(Variable(n, "input", unit, 0.0, sensor or n) for n, (unit, sensor, _) in _INPUTS.items()),
            *(Variable(n, "output", unit, 0.0, text, discrete=True) for n, (unit, text) in _OUTPUTS.items()),
        )
        self.initialize()

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """Into the first state; raises InputError for a parameter: it has none."""
        self.start_parameters(parameters)
        self._began, self._calls = time, 0
        self._inputs = np.zeros(len(_INPUTS))
        self._enter(time, self.table.start, 0.0)
        self._taken: dict[str, int] = {}
        self._news: tuple[str, ...] = ()
        self._speed = self._command("carriage") * 1e-3

    def _enter(self, time: float, state: str, travel: float) -> None:
        self._state, self._since, self._entry = state, time, travel
        self._peak, self._held = 0.0, ()

    def _command(self, key: str) -> float:
        return self.table.states[self._state].commands.get(key, 0.0)

    def set_inputs(self, values: np.ndarray) -> None:
        """Keep the sensors for the next call."""
        self._inputs = np.array(values, float)

    def next_event(self, time: float) -> float:
        """The end of the period."""
        period = self.table.period
        calls = self._calls
        while (due := self._began + (calls + 1) * period) <= time + _EARLY * period:
            calls += 1
        return due

    def events(self) -> tuple[str, ...]:
        """The transition of the last step."""
        return self._news

    def step(self, time: float, size: float) -> None:
        """Make the calls that are due by the end of the step."""
        self._news, period = (), self.table.period
        while (due := self._began + (self._calls + 1) * period) <= time + size + _EARLY * period:
            self._look(due)
            self._calls += 1

    def _sensors(self) -> dict[str, float]:
        found: dict[str, float] = {}
        for value, (_, sensor, factor) in zip(self._inputs, _INPUTS.values(), strict=True):
            if sensor:
                found[sensor] = found.get(sensor, 0.0) + factor * float(value)
        names = list(_INPUTS)
        found["wrist"] = float(np.linalg.norm(self._inputs[names.index("force.wrist.x") :][:3]))
        found["moved"] = found["travel"] - self._entry
        self._peak = max(self._peak, found["force"])
        found["drop"] = self._peak - found["force"]
        return found

    def _look(self, time: float) -> None:
        """One call: see whether the state is left, and command."""
        sensors, state = self._sensors(), self.table.states[self._state]
        since = dict(self._held)
        held: list[tuple[int, float]] = []
        for k, way in enumerate(state.leave):
            key = f"{state.name}.{k}"
            if self._taken.get(key, 0) >= way.at_most or not all(c.holds(sensors) for c in way.when):
                continue
            first = since.get(k, time)
            if time - first >= way.during - _EARLY:
                self._taken = self._taken | {key: self._taken.get(key, 0) + 1}
                self._go(time, way.to, sensors, " and ".join(f"{c.sensor} {c.relation} {c.value:g}" for c in way.when))
                break
            held.append((k, first))
        else:
            self._held = tuple(held)
            if time - self._since >= state.after - _EARLY:
                self._go(time, state.timeout, sensors, f"timeout of {state.after:g} s")
        commands = self.table.states[self._state].commands
        if "force" in commands:
            asked = commands["gain"] * (commands["force"] - sensors["force"])
            self._speed = 1e-3 * float(np.clip(asked, -commands["most"], commands["most"]))
        else:
            self._speed = 1e-3 * commands.get("carriage", 0.0)

    def _go(self, time: float, to: str, sensors: Mapping[str, float], why: str) -> None:
        self._news = (*self._news, f"{self._state} -> {to}: {why}")
        self._enter(time, to, sensors["travel"])

    @property
    def state(self) -> str:
        """The state's name."""
        return self._state

    def outputs(self) -> np.ndarray:
        """Commands of the last call."""
        c = self._command
        return np.array(
            [c("ring") * pi / 180, self._speed, c("motor"), c("brake"), c("latch"), c("servo"),
             self.table.names.index(self._state)]
        )  # fmt: skip

    def save(self) -> Any:
        """The complete state."""
        return (
            self._calls, self._inputs.copy(), self._state, self._since, self._entry, self._peak, self._held,
            self._taken, self._news, self._speed, self._began,
        )  # fmt: skip

    def restore(self, state: Any) -> None:
        """Back to a saved state."""
        (self._calls, inputs, self._state, self._since, self._entry, self._peak, self._held, self._taken,
         self._news, self._speed, self._began) = state  # fmt: skip
        self._inputs = inputs.copy()
