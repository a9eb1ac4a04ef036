"""Cases that any tool can answer: written without answers, and scored from a small JSON file."""
