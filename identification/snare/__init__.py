"""Captures: effects of the snare, with simulation in the loop."""
