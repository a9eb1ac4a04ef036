"""Rigid bodies, effects and model files: what is believed of the hardware."""
