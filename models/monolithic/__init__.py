"""The snare and the arm in one Exudyn system: the reference that a co-simulation is held against."""
