"""A position servo under a command: its simulation in closed loop, and its recordings as a source."""
