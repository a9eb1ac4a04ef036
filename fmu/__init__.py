"""Models and participants as FMUs: written for other tools."""
