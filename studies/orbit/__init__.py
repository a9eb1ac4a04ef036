"""The two captures in orbit: setting, run, ledgers, figures and page."""
