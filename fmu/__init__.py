"""Models and participants as FMUs: written for other tools, and foreign ones opened safely."""
