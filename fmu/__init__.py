"""Export of participants as FMUs. Empty until the exporter lands; nothing imports it."""
