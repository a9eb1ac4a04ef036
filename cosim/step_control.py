"""Step control: the macro step is chosen so that no participant's input is off by more than a tolerance.

At the end of a step it is known where each connected output has got to. The distance from where the hold's polynomial
had put it is the error of the inputs, of order H to the degree + 1. It is measured against a tolerance times the
output's magnitude; a step above 1 is rejected, and the next size follows by the usual controller,

    H_next = H · clip(0.9 · error ** (-1 / (degree + 1)), 0.2, 2)

(Hairer, Norsett & Wanner 1993, Solving Ordinary Differential Equations I, section II.4; for communication steps,
Schierz, Arnold & Clauss 2012, Co-simulation with communication step size control in an FMI compatible master
algorithm, Modelica Conference). A rejected step is repeated, so that participants must save and restore.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

import numpy as np

from ..errors import InputError, nearest

_SAFETY, _SLOWER, _FASTER = 0.9, 0.2, 2.0


@dataclass(frozen=True)
class StepControl:
    """Tolerance and bounds of the macro step.

    Parameters
    ----------
    tolerance : float
        Of a connected output at the end of a step, relative to its magnitude.
    magnitudes : mapping of str to float
        Of outputs ``participant.variable`` [its unit], ``*`` for any text; the largest absolute value so far where none
        is given. A contact force, zero until first contact, should have one; infinity leaves an output out.
    smallest, largest : float
        Bounds of the macro step [s]. A step of the smallest size is accepted whatever its error.
    """

    tolerance: float = 1e-3
    magnitudes: Mapping[str, float] = field(default_factory=dict)
    smallest: float = 1e-6
    largest: float = np.inf

    def __post_init__(self) -> None:
        """Refuse bounds that leave no step."""
        if not self.tolerance > 0:
            raise InputError(f"step control: tolerance {self.tolerance} must be positive")
        if not 0 < self.smallest <= self.largest:
            raise InputError(
                f"step control: smallest step {self.smallest} s must be positive, at most {self.largest} s"
            )

    def given_magnitudes(self, outputs: tuple[str, ...]) -> np.ndarray:
        """Magnitudes in the order of the outputs, 0 where none is given; InputError for an unknown name."""
        found = np.zeros(len(outputs))
        for name, value in self.magnitudes.items():
            meant = [i for i, output in enumerate(outputs) if fnmatchcase(output, name)]
            if not meant:
                raise InputError(f"step control: no output {name!r}; nearest is {nearest(name, outputs)!r}")
            if not value > 0:
                raise InputError(f"step control: magnitude {value} of {name} must be positive")
            found[meant] = value
        return found

    def next_size(self, size: float, error: float, degree: int, rejected: bool) -> float:
        """Size [s] after a step of this size and error (1 is just acceptable)."""
        factor = _FASTER if error == 0 else _SAFETY * error ** (-1.0 / (degree + 1))
        return float(
            np.clip(size * np.clip(factor, _SLOWER, 1.0 if rejected else _FASTER), self.smallest, self.largest)
        )
