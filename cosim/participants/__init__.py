"""Participants, one a file: whatever can be stepped by the co-simulation master."""
