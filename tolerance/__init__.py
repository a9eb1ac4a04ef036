"""Capture tolerances: over which misalignments a capture still succeeds, found by many simulated captures."""
