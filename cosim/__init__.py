"""Co-simulation in FMI's terms: `System`, `Master` and participants; see docs/cosimulation.md."""
