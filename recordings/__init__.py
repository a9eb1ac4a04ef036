"""Recordings of tests: reading, units, conditioning."""

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
