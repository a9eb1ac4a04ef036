"""Energy that the coupling makes or loses: the powers of two participants over one bond, compared.

Over a bond, one participant gives an effort e and reads a flow; the other gives the flow f and reads the effort. As
held inputs ẽ and f̃ differ from the outputs e and f, the two disagree about the power that crossed,

    residual power = ẽ f - e f̃        [W]

which is energy that neither of them had (Sadjina, Kyllingstad, Skjong & Pedersen 2017, Energy conservation and power
bonds in co-simulations, Engineering with Computers 33). Positive: the coupling has made energy, where effort times flow
as the flow's giver reads them is power into it. A reaction's sign (a connection's factor) is taken out.
"""

import numpy as np

from ..errors import InputError
from .system import PowerBond, System
from .units import conversion, quantity


class BondEnergy:
    """Residual and exchanged energy of every bond of a system, step by step.

    Parameters
    ----------
    system : System

    Raises
    ------
    InputError
        Where a bond's outputs are unknown, are not connected both ways, or do not make a power.
    """

    def __init__(self, system: System) -> None:
        """Find each bond's outputs and inputs."""
        self.names = tuple(bond.name for bond in system.bonds)
        rows = [_resolve(system, bond) for bond in system.bonds]
        self._effort, self._flow, self._effort_in, self._flow_in = (
            np.array([row[:4] for row in rows], dtype=np.intp).reshape(-1, 4).T
        )
        self._effort_factor, self._flow_factor, self._watts = np.array([row[4:] for row in rows]).reshape(-1, 3).T
        self.residual = np.zeros(len(rows))
        self.exchanged = np.zeros(len(rows))

    def add(self, before: np.ndarray, after: np.ndarray, held: np.ndarray, size: float) -> None:
        """One step: outputs (n_outputs,) at its ends, inputs' mean over it (n_inputs,), its size [s]."""
        effort = (before[self._effort] + after[self._effort]) / 2
        flow = (before[self._flow] + after[self._flow]) / 2
        joules = size * self._watts
        self.residual += joules * (
            held[self._effort_in] / self._effort_factor * flow - effort * held[self._flow_in] / self._flow_factor
        )
        self.exchanged += np.abs(joules * effort * flow)


def _resolve(system: System, bond: PowerBond) -> tuple[int, int, int, int, float, float, float]:
    """Indices of the outputs and of the inputs that read them, factors of the connections, watts of their product."""
    layout = system.layout
    for name in (bond.effort, bond.flow):
        if name not in layout.outputs:
            raise InputError(f"bond {bond.name}: {name!r} is no output; outputs are {', '.join(layout.outputs)}")
    inputs = []
    for source, reader in ((bond.effort, bond.flow), (bond.flow, bond.effort)):
        participant = reader.partition(".")[0]
        connection = system.connection(source, participant)
        if connection is None:
            raise InputError(f"bond {bond.name}: {source} is not connected to {participant}; connect both ways")
        index = layout.inputs.index(connection.target)
        if layout.offset[index] or not layout.factor[index]:
            raise InputError(f"bond {bond.name}: {source} -> {connection.target} has an offset or no factor")
        inputs.append(index)
    units = system.unit(bond.effort), system.unit(bond.flow)
    try:
        watts = conversion(f"{quantity(units[0]) * quantity(units[1])}", "W")[0] if all(units) else 1.0
    except InputError:
        raise InputError(
            f"bond {bond.name}: {bond.effort} [{units[0]}] times {bond.flow} [{units[1]}] is not a power; "
            "pair a force with a speed, or a torque with a rate"
        ) from None
    return (
        layout.outputs.index(bond.effort),
        layout.outputs.index(bond.flow),
        *inputs,
        float(layout.factor[inputs[0]]),
        float(layout.factor[inputs[1]]),
        watts,
    )
