"""Capture recordings: effects of the snare by simulation in the loop."""
