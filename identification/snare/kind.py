"""Captures as a kind of recording."""

from ..simulated import SimulatedKind
from .diagnose import diagnose_captures
from .identify import identify_captures
from .simulate import simulate_capture

KIND = SimulatedKind(diagnose_captures, identify_captures, simulate_capture)
