"""The zero-gravity rig study (Tian, Tang, Dai and Li): an independent plant, and the study that explains it."""
