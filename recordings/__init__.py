"""Recordings of tests: reading, units, conditioning."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .find import find_recording
    from .read import read_recording
    from .signals import JointKind, Signal, default_unit
    from .timebase import Sampling, sampling
    from .write import demand_suffix, write_frame, write_recording

__all__ = [
    "JointKind",
    "Sampling",
    "Signal",
    "default_unit",
    "demand_suffix",
    "find_recording",
    "read_recording",
    "sampling",
    "write_frame",
    "write_recording",
]

_PLACES = {
    "JointKind": ".signals",
    "Sampling": ".timebase",
    "Signal": ".signals",
    "default_unit": ".signals",
    "demand_suffix": ".write",
    "find_recording": ".find",
    "read_recording": ".read",
    "sampling": ".timebase",
    "write_frame": ".write",
    "write_recording": ".write",
}


def __getattr__(name: str) -> Any:
    """Load a name when it is first asked for: an FMU's process needs units, and not the readers of every format."""
    if name not in _PLACES:
        raise AttributeError(f"module 'snarelab.recordings' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(_PLACES[name], __name__), name)
