"""Participants, one file each: anything that the co-simulation master can step."""
