"""Co-simulation in FMI's terms. Empty until the master lands; nothing imports it."""
