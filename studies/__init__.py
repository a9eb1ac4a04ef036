"""Studies: one file each, run by ``make study-NAME``."""
