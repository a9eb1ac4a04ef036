"""Docking tests as a source: effects of carriage, grooves and latches, with simulation in the loop."""
