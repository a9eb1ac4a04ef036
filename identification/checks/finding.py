"""Findings of the checks: frozen values for JSON, page and sentence."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .case import CheckCase
    from .reading import Reading


@dataclass(frozen=True)
class CheckFinding:
    """One finding of a check.

    Parameters
    ----------
    name : str
        ``unit``, ``sign`` and so on; see the folder ``kinds``.
    at : str
        A channel (``tau.joint2``), a joint, a link, a recording, or ``gravity`` and ``time``.
    probability : float
        Of this name and place among all readings that were compared (0 to 1).
    message : str
        What it is, with the numbers.
    mend : str
        A line for the model file, or several.
    fault : bool
        Whether recording and model contradict each other while it stands.
    """

    name: str
    at: str
    probability: float
    message: str
    mend: str
    fault: bool = True

    def to_json(self) -> dict[str, Any]:
        """As ``checks`` of a result has it."""
        published = asdict(self)
        del published["fault"]
        return published


@dataclass(frozen=True)
class Kind:
    """A kind of check: its competing readings, or its own findings.

    Parameters
    ----------
    name : str
    sentence : str
        What is wrong, in words.
    readings : callable, optional
        From a case to readings; their log prior odds are shared among them.
    find : callable, optional
        From a case to findings, for what is seen without the model's torque or beside it.
    early : bool
        Whether ``find`` comes before the readings, because they could not be compared else.
    """

    name: str
    sentence: str
    readings: "Callable[[CheckCase], list[Reading]] | None" = None
    find: "Callable[[CheckCase], list[CheckFinding]] | None" = None
    early: bool = False
