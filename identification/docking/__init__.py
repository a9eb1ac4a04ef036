"""Docking recordings: effects of carriage, grooves and latches by simulation in the loop, by the one evidence."""
