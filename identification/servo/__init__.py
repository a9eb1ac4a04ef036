"""Recordings of a position servo under a command as a source."""
