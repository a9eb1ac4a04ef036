"""A system and its run: the content of a system file."""

from dataclasses import dataclass

from .iteration import Iteration
from .master import HoldName, Master, Scheme
from .step_control import StepControl
from .system import System


@dataclass(frozen=True)
class Setup:
    """A system and its run.

    Parameters
    ----------
    system : System
    step, start, stop : float
        Macro step, first and last time [s].
    scheme, hold, iterate, control
        As `Master` takes them.
    open : tuple of str
        Inputs that the file leaves open: they keep their start values.
    """

    system: System
    step: float = 1e-3
    start: float = 0.0
    stop: float = 1.0
    scheme: Scheme = "jacobi"
    hold: HoldName = "midpoint"
    iterate: bool | Iteration = False
    control: StepControl | None = None
    open: tuple[str, ...] = ()

    def master(self) -> Master:
        """A master at the start."""
        return Master(
            self.system,
            self.step,
            start=self.start,
            scheme=self.scheme,
            hold=self.hold,
            iterate=self.iterate,
            control=self.control,
        )
