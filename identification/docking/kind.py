"""Docking tests as a kind of recording."""

from ..simulated import SimulatedKind
from .diagnose import diagnose_dockings
from .identify import identify_dockings
from .simulate import simulate_docking

KIND = SimulatedKind(diagnose_dockings, identify_dockings, simulate_docking)
