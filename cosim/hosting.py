"""Where a participant runs: in its own process, or in this one."""

from collections.abc import Callable
from dataclasses import dataclass

from .participant import Participant
from .process import OwnProcess


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
