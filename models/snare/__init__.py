"""The snare: cables of ANCF elements, their contact with the pin, and the ring that turns (Exudyn)."""
