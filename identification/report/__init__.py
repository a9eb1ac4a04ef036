"""The report of a diagnosis: one offline page."""
