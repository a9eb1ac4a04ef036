"""The whole decision, for any kind of recording: search, confirm, search again, and what has no name."""
