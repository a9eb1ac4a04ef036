"""A system together with how it is to be run: what a system file says."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from .iteration import Iteration
from .master import HoldName, Master, Scheme
from .participant import Participant
from .process import OwnProcess
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


@dataclass(frozen=True)
class Hosting:
    """Where participants from a file run.

    Parameters
    ----------
    own_process : bool
        Each in a process of its own, so that a crash or a hang costs the run only; else all in this one.
    timeout : float
        Longest wait for a step [s], of those in their own process.
    """

    own_process: bool = True
    timeout: float = 60.0

    def build(self, make: Callable[..., Participant], *arguments: object, **keywords: object) -> Participant:
        """The participant ``make(*arguments, **keywords)``."""
        if self.own_process:
            return OwnProcess(make, *arguments, timeout=self.timeout, **keywords)
        return make(*arguments, **keywords)


def load_setup(path: str | Path, hosting: Hosting | None = None) -> Setup:
    """Read a system file, ``.ssp`` or ``.toml``; raises InputError for another kind, and for what is wrong in it."""
    from .ssp import read_ssp
    from .toml_system import read_toml

    path = Path(path)
    readers = {".ssp": read_ssp, ".toml": read_toml}
    if path.suffix.lower() not in readers:
        raise InputError(f"{path}: a system file is .ssp or .toml, not {path.suffix!r}; give one of these")
    if not path.is_file():
        raise InputError(f"{path}: is not there; give the path of a system file")
    return readers[path.suffix.lower()](path, hosting or Hosting())
